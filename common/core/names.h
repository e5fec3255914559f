#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace exmat {

/// Names of an enumeration, in the order of its values, which count from 0; specialised beside the enumeration.
template <typename Enum>
inline constexpr std::array<std::string_view, 0> kNames{};

/// An enumeration that has names: those of files and messages.
template <typename Enum>
concept Named = (!kNames<Enum>.empty());

template <Named Enum>
constexpr std::string_view name_of(Enum value) {
  return kNames<Enum>[static_cast<std::size_t>(value)];
}

/// Nothing for a name that this version does not know.
template <Named Enum>
constexpr std::optional<Enum> from_name(std::string_view name) {
  for (std::size_t i = 0; i < kNames<Enum>.size(); ++i)
    if (kNames<Enum>[i] == name) return static_cast<Enum>(i);
  return std::nullopt;
}

}  // namespace exmat
