#include "common/core/plain_json.h"

#include <cstdlib>
#include <stdexcept>
#include <utility>

namespace exmat {

class PlainJson::Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  PlainJson parse() {
    PlainJson json = value();
    skip_blanks();
    require(at_ == text_.size());
    return json;
  }

 private:
  PlainJson value() {
    skip_blanks();
    PlainJson json;
    const char first = peek();
    if (first == '{') {
      json.kind_ = Kind::kObject;
      list('{', '}', [&] {
        skip_blanks();
        std::string name = string();
        take(':');
        json.members_.emplace_back(std::move(name), value());
      });
    } else if (first == '[') {
      json.kind_ = Kind::kList;
      list('[', ']', [&] { json.items_.push_back(value()); });
    } else if (first == '"') {
      json.kind_ = Kind::kText;
      json.text_ = string();
    } else if (word("null")) {
      json.kind_ = Kind::kNull;
    } else if (word("true") || word("false")) {
      json.kind_ = Kind::kBoolean;
      json.number_ = first == 't' ? 1 : 0;
    } else {
      json.kind_ = Kind::kNumber;
      json.number_ = decimal();
    }
    return json;
  }

  // In any locale, and exact for numbers of up to 15 digits with exponents of up to 22.
  double decimal() {
    const bool is_negative = word("-");
    double digits = 0;
    int exponent = 0;
    const std::size_t begin = at_;
    const auto take_digits = [&](int shift) {
      for (; at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9'; ++at_, exponent += shift)
        digits = 10 * digits + (text_[at_] - '0');
    };
    take_digits(0);
    require(at_ > begin);
    if (word(".")) take_digits(-1);
    if (word("e") || word("E")) {
      const double mantissa = std::exchange(digits, 0);
      const bool is_small = word("-");
      if (!is_small) word("+");
      take_digits(0);
      exponent += is_small ? -static_cast<int>(digits) : static_cast<int>(digits);
      digits = mantissa;
    }
    double power = 1;
    for (int i = 0; i < std::abs(exponent); ++i) power *= 10;
    const double value = exponent < 0 ? digits / power : digits * power;
    return is_negative ? -value : value;
  }

  template <typename Element>
  void list(char open, char close, Element element) {
    take(open);
    skip_blanks();
    if (peek() == close) return take(close);
    for (;;) {
      element();
      skip_blanks();
      if (peek() == close) return take(close);
      take(',');
    }
  }

  std::string string() {
    std::string text;
    for (take('"'); peek() != '"'; ++at_) {
      if (peek() != '\\') {
        text += peek();
        continue;
      }
      ++at_;
      const char escaped = peek();
      require(escaped != 'u');  // schemas have UTF-8 as it is
      text += escaped == 'n' ? '\n' : escaped == 't' ? '\t' : escaped;
    }
    ++at_;
    return text;
  }

  bool word(std::string_view word) {
    if (!text_.substr(at_).starts_with(word)) return false;
    at_ += word.size();
    return true;
  }

  char peek() const {
    require(at_ < text_.size());
    return text_[at_];
  }
  void take(char expected) {
    skip_blanks();
    require(peek() == expected);
    ++at_;
  }
  void skip_blanks() {
    while (at_ < text_.size() && std::string_view(" \t\r\n").find(text_[at_]) != std::string_view::npos) ++at_;
  }
  void require(bool condition) const {
    if (!condition) throw std::logic_error("JSON: unexpected text at byte " + std::to_string(at_));
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

namespace {

void require_kind(PlainJson::Kind kind, PlainJson::Kind expected, const char* name) {
  if (kind != expected) throw std::logic_error(std::string("JSON: expected ") + name);
}

}  // namespace

PlainJson PlainJson::parse(std::string_view text) { return Parser(text).parse(); }

double PlainJson::number() const {
  require_kind(kind_, Kind::kNumber, "a number");
  return number_;
}

const std::string& PlainJson::text() const {
  require_kind(kind_, Kind::kText, "a text");
  return text_;
}

const std::vector<PlainJson>& PlainJson::items() const {
  require_kind(kind_, Kind::kList, "a list");
  return items_;
}

const std::vector<PlainJson::Member>& PlainJson::members() const {
  require_kind(kind_, Kind::kObject, "an object");
  return members_;
}

const PlainJson* PlainJson::find(std::string_view name) const {
  for (const Member& member : members())
    if (member.first == name) return &member.second;
  return nullptr;
}

const PlainJson& PlainJson::at(std::string_view name) const {
  const PlainJson* const member = find(name);
  if (member == nullptr) throw std::logic_error("JSON: no member " + std::string(name));
  return *member;
}

std::vector<std::string> PlainJson::texts() const {
  std::vector<std::string> texts;
  for (const PlainJson& item : items()) texts.push_back(item.text());
  return texts;
}

}  // namespace exmat
