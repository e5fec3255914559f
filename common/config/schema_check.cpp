#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <stdexcept>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>
#include <vector>

#include "common/config/embedded_schema.h"
#include "common/config/json_file.h"
#include "common/core/error.h"
#include "common/core/nearest_name.h"
#include "common/core/number_limits.h"

// valijson decides whether a document is valid. Its messages name schema keywords, so the first fault is then looked up
// here in the words of the schema's own descriptions.

namespace exmat {
namespace {

using Json = nlohmann::json;
using Adapter = valijson::adapters::NlohmannJsonAdapter;

constexpr std::size_t kLongestValue = 60;
constexpr const char* kLater = "x-later";
constexpr const char* kAdvice = "x-advice";

std::string show(const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > kLongestValue) text = text.substr(0, kLongestValue) + "...";
  return text;
}

std::string list(const Json& values, const char* last_word) {
  std::string text;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) text += i + 1 == values.size() ? last_word : ", ";
    text += show(values[i]);
  }
  return text;
}

// An object that has one of several members names these.
std::string member_names(const Json& schema) {
  Json names = Json::array();
  if (schema.contains("oneOf")) {
    for (const Json& choice : schema["oneOf"]) names.push_back(choice.at("required").front());
    std::sort(names.begin(), names.end());
    return list(names, " and ");
  }
  for (const auto& [name, member] : schema.at("properties").items()) names.push_back(name);
  return list(names, " and ");
}

std::string range_of(const Json& schema) {
  std::vector<std::string> parts;
  for (const auto& [rule, symbol] :
       {std::pair{"minimum", ">="}, {"exclusiveMinimum", ">"}, {"maximum", "<="}, {"exclusiveMaximum", "<"}})
    if (schema.contains(rule)) parts.push_back(fmt::format("{} {}", symbol, show(schema[rule])));
  return parts.empty() ? "" : fmt::format(" {}", fmt::join(parts, " and "));
}

std::string range_of(const Json& schema, const char* least, const char* most, const char* unit) {
  if (schema.contains(least) && schema.contains(most) && schema[least] == schema[most])
    return fmt::format(" of {} {}", show(schema[least]), unit);
  std::vector<std::string> parts;
  if (schema.contains(least)) parts.push_back(fmt::format("at least {}", show(schema[least])));
  if (schema.contains(most)) parts.push_back(fmt::format("at most {}", show(schema[most])));
  return parts.empty() ? "" : fmt::format(" of {} {}", fmt::join(parts, " and "), unit);
}

std::string expectation(const Json& schema, const std::string& type) {
  if (type == "string") return fmt::format("a string{}", range_of(schema, "minLength", "maxLength", "characters"));
  if (type == "integer") return fmt::format("an integer{}", range_of(schema));
  if (type == "number") return fmt::format("a number{}", range_of(schema));
  if (type == "boolean") return "true or false";
  if (type == "array") return fmt::format("an array{}", range_of(schema, "minItems", "maxItems", "elements"));
  const bool has_one = schema.contains("minProperties") || schema.contains("oneOf");
  return has_one ? fmt::format("exactly one of {}", member_names(schema)) : "an object";
}

/// One, or several in an array.
std::vector<std::string> types_of(const Json& schema) {
  const Json& types = schema.at("type");
  if (types.is_string()) return {types.get<std::string>()};
  return types.get<std::vector<std::string>>();
}

std::string expectation(const Json& schema) {
  if (schema.contains("enum")) return list(schema["enum"], " or ");
  std::vector<std::string> each;
  for (const std::string& type : types_of(schema)) each.push_back(expectation(schema, type));
  return fmt::format("{}", fmt::join(each, ", or "));
}

class FaultFinder {
 public:
  explicit FaultFinder(const Json& schema) : root_(schema) {}

  // The first fault in reading order of the schema's rules; nothing if none is known here.
  std::optional<Complaint> find(const Json& schema_or_reference, const Json& value,
                                const Json::json_pointer& place) const {
    const Json& schema = resolve(schema_or_reference);
    if (!has_type(schema, value)) return mismatch(schema, value, place);
    if (auto fault = find_value(schema, value, place)) return fault;
    if (value.is_object()) return find_in_object(schema, value, place);
    if (value.is_array()) return find_in_array(schema, value, place);
    return std::nullopt;
  }

 private:
  const Json& resolve(const Json& schema) const {
    if (!schema.contains("$ref")) return schema;
    return root_.at(Json::json_pointer(schema["$ref"].get<std::string>().substr(1)));
  }

  static bool has_type(const Json& schema, const Json& value) {
    return std::ranges::any_of(types_of(schema), [&](const std::string& type) {
      if (type == "integer") return value.is_number_integer();
      if (type == "number") return value.is_number();
      return type == value.type_name();
    });
  }

  static std::optional<Complaint> mismatch(const Json& schema, const Json& value, const Json::json_pointer& place) {
    return Complaint{"", place.to_string(), expectation(schema), show(value), schema.value(kAdvice, std::string())};
  }

  static std::optional<Complaint> not_yet(const Json& value, const Json::json_pointer& place) {
    return Complaint{"", place.to_string(), "", show(value), "this version does not support it yet"};
  }

  static bool is_in_range(const Json& schema, const Json& value) {
    const auto breaks = [&](const char* rule, auto is_broken) {
      return schema.contains(rule) && is_broken(value.get<double>(), schema[rule].get<double>());
    };
    return !breaks("minimum", std::less<>()) && !breaks("maximum", std::greater<>()) &&
           !breaks("exclusiveMinimum", std::less_equal<>()) && !breaks("exclusiveMaximum", std::greater_equal<>());
  }

  static std::optional<Complaint> find_value(const Json& schema, const Json& value, const Json::json_pointer& place) {
    const Json later = schema.value(kLater, Json());
    if (schema.contains("enum") && !contains(schema["enum"], value))
      return contains(later, value) ? not_yet(value, place) : mismatch(schema, value, place);
    if (value.is_number() && !is_in_range(schema, value)) {
      const bool is_above = schema.contains("maximum") && value.get<double>() > schema["maximum"].get<double>();
      return later == true && is_above ? not_yet(value, place) : mismatch(schema, value, place);
    }
    if (value.is_string() && !has_length(schema, "minLength", "maxLength", value.get<std::string>().size()))
      return mismatch(schema, value, place);
    return std::nullopt;
  }

  static bool has_length(const Json& schema, const char* least, const char* most, std::size_t length) {
    return (!schema.contains(least) || length >= schema[least].get<std::size_t>()) &&
           (!schema.contains(most) || length <= schema[most].get<std::size_t>());
  }

  static bool contains(const Json& values, const Json& value) {
    return std::find(values.begin(), values.end(), value) != values.end();
  }

  std::optional<Complaint> find_in_object(const Json& schema, const Json& value,
                                          const Json::json_pointer& place) const {
    const Json& members = schema.at("properties");
    for (const auto& [name, member] : value.items())
      if (!members.contains(name)) return unknown_member(schema, name, place);
    for (const Json& name : schema.value("required", Json::array()))
      if (!value.contains(name))
        return missing_member(resolve(members.at(name)), members.at(name), place / name.get<std::string>());
    if (!has_length(schema, "minProperties", "maxProperties", value.size())) return mismatch(schema, value, place);
    const Json choices = schema.value("oneOf", Json::array());
    const auto is_there = [&](const Json& choice) { return value.contains(choice["required"].front()); };
    if (!choices.empty() && std::ranges::count_if(choices, is_there) != 1) return mismatch(schema, value, place);
    for (const auto& [name, member] : value.items())
      if (auto fault = find(members.at(name), member, place / name)) return fault;
    return std::nullopt;
  }

  static std::optional<Complaint> unknown_member(const Json& schema, const std::string& name,
                                                 const Json::json_pointer& place) {
    if (schema.contains(kLater) && contains(schema[kLater], name)) return not_yet(Json(name), place / name);
    std::vector<std::string> members;
    for (const auto& [member, definition] : schema.at("properties").items()) members.push_back(member);
    const std::string nearest = nearest_name(name, members);
    const std::string advice = nearest.empty() ? fmt::format("members here are {}", member_names(schema))
                                               : fmt::format("did you mean {}?", show(Json(nearest)));
    return Complaint{"", (place / name).to_string(), "", "",
                     fmt::format("unknown member {}; {}", show(Json(name)), advice)};
  }

  static std::optional<Complaint> missing_member(const Json& schema, const Json& member,
                                                 const Json::json_pointer& place) {
    const std::string meaning = member.value("description", std::string());
    return Complaint{"", place.to_string(), fmt::format("{} ({})", expectation(schema), meaning), "no such member", ""};
  }

  std::optional<Complaint> find_in_array(const Json& schema, const Json& value, const Json::json_pointer& place) const {
    if (!has_length(schema, "minItems", "maxItems", value.size())) return mismatch(schema, value, place);
    for (std::size_t i = 0; i < value.size(); ++i)
      if (auto fault = find(schema.at("items"), value[i], place / i)) return fault;
    if (!schema.value("uniqueItems", false)) return std::nullopt;
    for (std::size_t i = 0; i < value.size(); ++i)
      if (std::find(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(i), value[i]) - value.begin() <
          static_cast<std::ptrdiff_t>(i))
        return Complaint{"", (place / i).to_string(), "each element once", show(value[i]) + " again", ""};
    return std::nullopt;
  }

  const Json& root_;
};

/// The first number, in reading order, that check_numbers() refuses, and the way there from its end; null: none.
const Json* find_absurd(const Json& value, std::vector<std::string>& way) {
  if (value.is_number()) {
    const double number = value.get<double>();
    return is_near(number) && (number == 0 || std::isnormal(number)) ? nullptr : &value;
  }
  if (!value.is_structured()) return nullptr;
  for (const auto& member : value.items())
    if (const Json* const found = find_absurd(member.value(), way)) {
      way.push_back(member.key());
      return found;
    }
  return nullptr;
}

}  // namespace

void check_numbers(const Json& document, const std::filesystem::path& file) {
  std::vector<std::string> way;
  const Json* const found = find_absurd(document, way);
  if (found == nullptr) return;
  Json::json_pointer place;
  for (auto member = way.rbegin(); member != way.rend(); ++member) place /= *member;
  throw InputError({file.string(), place.to_string(),
                    is_near(found->get<double>()) ? "0, or a number of at least 2.3e-308 in magnitude"
                                                  : fmt::format("a number of at most {:g} in magnitude", kFarthest),
                    show(*found), "mend the number or its unit"});
}

void check_against_schema(const Json& document, const std::string& schema_name, const std::filesystem::path& file) {
  const Json schema_json = Json::parse(embedded_schema(schema_name));
  valijson::Schema schema;
  valijson::SchemaParser(valijson::SchemaParser::kDraft7).populateSchema(Adapter(schema_json), schema);
  valijson::ValidationResults results;
  if (valijson::Validator().validate(schema, Adapter(document), &results)) return;

  auto complaint = FaultFinder(schema_json).find(schema_json, document, Json::json_pointer());
  if (!complaint) complaint = Complaint{"", "", "", "", results.begin()->description};
  complaint->file = file.string();
  throw InputError(*complaint);
}

}  // namespace exmat
