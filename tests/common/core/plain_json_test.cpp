#include "common/core/plain_json.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "common/config/embedded_schema.h"

namespace exmat {
namespace {

using Json = nlohmann::ordered_json;

Json as_json(const PlainJson& plain) {
  switch (plain.kind()) {
    case PlainJson::Kind::kNumber:
      return plain.number();
    case PlainJson::Kind::kText:
      return plain.text();
    case PlainJson::Kind::kList: {
      Json list = Json::array();
      for (const PlainJson& item : plain.items()) list.push_back(as_json(item));
      return list;
    }
    case PlainJson::Kind::kObject: {
      Json object = Json::object();
      for (const auto& [name, member] : plain.members()) object[name] = as_json(member);
      return object;
    }
    default:
      return nullptr;  // true and false, too
  }
}

Json without_booleans(Json json) {
  if (json.is_boolean()) return nullptr;
  if (!json.is_structured()) return json;
  for (auto& [name, member] : json.items()) member = without_booleans(member);
  return json;
}

TEST(PlainJson, ReadsEverySchemaAsAnotherReaderDoes) {
  for (const char* const name : {"asset", "bundle", "scene", "state", "study", "trajectory"}) {
    const std::string_view text = embedded_schema(name);
    EXPECT_EQ(as_json(PlainJson::parse(text)), without_booleans(Json::parse(text))) << name;
  }
}

TEST(PlainJson, ReadsNumbersAndTexts) {
  for (const char* const number : {"0", "-1", "0.001", "1e-9", "-2.5E+3", "1000000", "123456789012345", "1e22"})
    EXPECT_EQ(PlainJson::parse(number).number(), Json::parse(number).get<double>()) << number;
  EXPECT_EQ(PlainJson::parse(R"( "a\"\\\n" )").text(), "a\"\\\n");
}

TEST(PlainJson, RefusesWhatIsNone) {
  for (const char* const text : {"", "{", "[1,", "{\"a\" 1}", "1 2", "-", "\"a", "{\"a\": 1}}", "nul"})
    EXPECT_THROW(PlainJson::parse(text), std::logic_error) << text;
  EXPECT_THROW(PlainJson::parse("[1]").at("a"), std::logic_error);
  EXPECT_THROW(PlainJson::parse("{}").at("a"), std::logic_error);
}

}  // namespace
}  // namespace exmat
