#include "common/config/json_file.h"

#include <algorithm>
#include <fmt/format.h>
#include <set>
#include <vector>

#include "common/core/error.h"
#include "common/core/input_file.h"

namespace exmat {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMaxDepth = 64;

std::string line_and_column(const std::string& text, std::size_t position) {
  const std::size_t before = std::min(position == 0 ? 0 : position - 1, text.size());
  const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(before), '\n');
  const auto line_begin = before == 0 ? std::string::npos : text.rfind('\n', before - 1);
  const std::size_t column = before - (line_begin == std::string::npos ? 0 : line_begin + 1) + 1;
  return fmt::format("line {}, column {}", line, column);
}

// "[json.exception.parse_error.101] parse error at line 1, column 2: syntax error while ..." without what stands
// elsewhere.
std::string without_prefix(std::string message) {
  for (const std::string_view mark : {"] ", ": syntax error "}) {
    const auto at = message.find(mark);
    if (at != std::string::npos) message.erase(0, at + mark.size());
  }
  return message;
}

// Checks what the document tree no longer shows.
class StructureCheck : public nlohmann::json_sax<Json> {
 public:
  StructureCheck(const std::string& file, const std::string& text) : file_(file), text_(text) {}

  bool null() override { return value(); }
  bool boolean(bool) override { return value(); }
  bool number_integer(number_integer_t) override { return value(); }
  bool number_unsigned(number_unsigned_t) override { return value(); }
  bool number_float(number_float_t, const string_t&) override { return value(); }
  bool binary(binary_t&) override { return value(); }
  bool string(string_t& text) override {
    value();
    check_characters(text);
    return true;
  }

  bool start_object(std::size_t) override { return open(false); }
  bool start_array(std::size_t) override { return open(true); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    Level& level = levels_.back();
    level.member = name;
    check_characters(name);
    if (!level.members.insert(name).second) fail(pointer(), "each member once", "it is repeated");
    return true;
  }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& error) override {
    fail(line_and_column(text_, position), "", without_prefix(error.what()));
  }

 private:
  struct Level {
    bool is_array = false;
    std::size_t next = 0;
    std::string member;
    std::set<std::string> members;
  };

  bool value() {
    if (!levels_.empty() && levels_.back().is_array) levels_.back().member = std::to_string(levels_.back().next++);
    return true;
  }

  bool open(bool is_array) {
    value();
    if (levels_.size() >= kMaxDepth) fail(pointer(), fmt::format("at most {} nested levels", kMaxDepth), "more");
    levels_.emplace_back().is_array = is_array;
    return true;
  }

  bool close() {
    levels_.pop_back();
    return true;
  }

  void check_characters(const std::string& text) const {
    const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; };
    const auto found = std::find_if(text.begin(), text.end(), is_control);
    if (found != text.end())
      fail(pointer(), "no control characters", fmt::format("character U+{:04X}", static_cast<unsigned char>(*found)));
  }

  std::string pointer() const {
    Json::json_pointer pointer;
    for (const Level& level : levels_) pointer /= level.member;
    return pointer.to_string();
  }

  [[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found) const {
    throw InputError({file_, place, expected, found, ""});
  }

  const std::string& file_;
  const std::string& text_;
  std::vector<Level> levels_;
};

}  // namespace

nlohmann::json read_json(const std::filesystem::path& file) {
  const std::string text = read_text_file(file, "a JSON file");
  if (const std::string_view kind = kind_of_file(file, text); !kind.empty() && kind != kJson)
    throw InputError(
        {file.string(), "", "a JSON file", std::string(kind),
         "a scene names its bundle in a JSON file, an asset its mesh; exmat-precompute bundle takes a surface "
         "(.glb, .obj) by itself"});
  return parse_json(text, file.string());
}

nlohmann::json parse_json(const std::string& text, const std::string& name) {
  // nlohmann would end the text there and leave the rest unread.
  if (const auto nul = text.find('\0'); nul != std::string::npos)
    throw InputError({name, line_and_column(text, nul + 1), "text", "character U+0000", "is the file damaged?"});
  StructureCheck check(name, text);
  Json::sax_parse(text, &check);
  return Json::parse(text);
}

}  // namespace exmat
