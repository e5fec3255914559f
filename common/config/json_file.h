#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace exmat {

/// Reads and parses a JSON file (RFC 8259). Throws InputError: no such file, a syntax error with line and column, bytes
/// after the end, a repeated member, more than 64 nested levels, numbers beyond double, control characters in strings.
nlohmann::json read_json(const std::filesystem::path& file);

/// The same of a text; `name` is for messages.
nlohmann::json parse_json(const std::string& text, const std::string& name);

/// Throws InputError unless the document follows schemas/NAME.json: at the first fault, with its JSON pointer, what was
/// expected and found. An unknown member suggests the nearest name; what the schema lists as x-later is refused as not
/// supported yet, and its x-advice is said with what is refused.
void check_against_schema(const nlohmann::json& document, const std::string& schema_name,
                          const std::filesystem::path& file);

/// Throws InputError at the first number that is none to compute with: larger than kFarthest in magnitude, or so small
/// that a double has not all its digits (subnormal).
void check_numbers(const nlohmann::json& document, const std::filesystem::path& file);

}  // namespace exmat
