#pragma once

#include <gtest/gtest.h>
#include <map>
#include <string>
#include <string_view>

#include "common/bundle/fields.h"

namespace exmat::test {

/// Every field as text, by path: compares models whatever their types.
class FieldText {
 public:
  explicit FieldText(const ReducedModel& model) { visit_fields(model, *this); }

  void group(std::string_view, std::string_view path) { group_ = path; }
  template <typename T>
  void attribute(std::string_view name, const T& member) {
    fields[group_ + "@" + std::string(name)] = ::testing::PrintToString(to_attribute(member));
  }
  template <typename T>
  void dataset(std::string_view name, const T& member) {
    const ArrayView view = view_of(member);
    const auto bytes = static_cast<std::size_t>(view.rows * view.cols) * size_of(view.type);
    fields[group_ + "/" + std::string(name)] = std::to_string(view.rows) + " x " + std::to_string(view.cols) + ": " +
                                               std::string(static_cast<const char*>(view.data), bytes);
  }

  std::map<std::string, std::string> fields;

 private:
  std::string group_;
};

}  // namespace exmat::test
