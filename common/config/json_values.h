#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/core/names.h"

namespace exmat {

using Json = nlohmann::json;

// Members of documents that check_against_schema has passed.

inline Json member_or(const Json& object, const char* name, Json fallback) {
  return object.contains(name) ? object[name] : std::move(fallback);
}

/// A choice by its name; the schema lists those of kNames.
template <Named Choice>
Choice choice_or(const Json& object, const char* name, Choice fallback) {
  return object.contains(name) ? from_name<Choice>(object[name].template get<std::string>()).value() : fallback;
}

template <typename T>
std::optional<T> optional_member(const Json& object, const char* name) {
  return object.contains(name) ? std::optional<T>(object[name].template get<T>()) : std::nullopt;
}

/// A path of a JSON file, relative to that file.
std::filesystem::path resolve_path(const std::filesystem::path& json_file, const std::string& path);

/// Throws InputError where `file` is not there, which names the place of the JSON file that names it.
void require_file(const std::filesystem::path& file, const std::filesystem::path& json_file, const std::string& place,
                  const std::string& expected, const std::string& advice = "");

/// 0-based vertex ids; throws InputError where one is repeated.
std::vector<std::int64_t> read_ids(const Json& ids, const std::filesystem::path& json_file, const std::string& place);

}  // namespace exmat
