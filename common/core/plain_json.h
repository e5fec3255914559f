#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace exmat {

/// JSON that is compiled in, as the schemas are: members in the order of the text. Text from users is read by
/// common/config, whose messages have a place in the file; here a fault is a std::logic_error.
class PlainJson {
 public:
  enum class Kind { kNull, kBoolean, kNumber, kText, kList, kObject };
  using Member = std::pair<std::string, PlainJson>;

  static PlainJson parse(std::string_view text);

  Kind kind() const { return kind_; }
  double number() const;
  const std::string& text() const;
  const std::vector<PlainJson>& items() const;
  const std::vector<Member>& members() const;
  /// Null where there is no such member.
  const PlainJson* find(std::string_view name) const;
  const PlainJson& at(std::string_view name) const;
  std::vector<std::string> texts() const;

 private:
  class Parser;

  Kind kind_ = Kind::kNull;
  double number_ = 0;
  std::string text_;
  std::vector<PlainJson> items_;
  std::vector<Member> members_;
};

}  // namespace exmat
