#include "common/hdf5/value_checks.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace exmat {
namespace {

using Kind = Constraint::Kind;

// Tolerance relative to the largest entry: products such as E^T E are symmetric to rounding only.
constexpr double kSymmetryTolerance = 1e-9;

// "[12][0][2]" of a flat index.
std::string subscript(std::span<const std::int64_t> sizes, std::size_t index) {
  std::string text;
  for (std::size_t axis = sizes.size(); axis-- > 0;) {
    const auto size = static_cast<std::size_t>(sizes[axis]);
    text = fmt::format("[{}]{}", index % size, text);
    index /= size;
  }
  return text;
}

template <typename T>
std::string at(std::span<const std::int64_t> sizes, std::size_t index, T value) {
  return sizes.empty() ? fmt::format("{}", value) : fmt::format("{} at {}", value, subscript(sizes, index));
}

// Constraints on one element: its expectation, or nothing for the other kinds.
template <typename T>
std::optional<std::string> broken_rule(const Constraint& constraint, T value, const SymbolSizes& sizes_known) {
  switch (constraint.kind) {
    case Kind::kPositive:
      return value > 0 ? std::nullopt : std::optional("a number > 0");
    case Kind::kNonNegative:
      return value >= 0 ? std::nullopt : std::optional("a number >= 0");
    case Kind::kUnitInterval:
      return value >= 0 && value <= 1 ? std::nullopt : std::optional("a number from 0 to 1");
    case Kind::kPoisson:
      return static_cast<double>(value) > -1 && static_cast<double>(value) < 0.5
                 ? std::nullopt
                 : std::optional("a number above -1 and below 0.5");
    case Kind::kFlag:
      return value == 0 || value == 1 ? std::nullopt : std::optional("0 or 1");
    case Kind::kIndex: {
      const auto* bound = sizes_known.find(constraint.argument);
      const bool below = bound == nullptr || value < static_cast<T>(bound->value);
      if (value >= 0 && below) return std::nullopt;
      return bound == nullptr ? "an index >= 0"
                              : fmt::format("an index from 0 to {} ({} = {} from {})", bound->value - 1,
                                            constraint.argument, bound->value, bound->bound_by);
    }
    default:
      return std::nullopt;
  }
}

template <typename T>
std::optional<ValueFault> check_elements(const Constraint& constraint, std::span<const std::int64_t> sizes,
                                         std::span<const T> values, const SymbolSizes& sizes_known) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (const auto expected = broken_rule(constraint, values[i], sizes_known))
      return ValueFault{*expected, at(sizes, i, values[i])};
  return std::nullopt;
}

template <typename T>
std::optional<ValueFault> check_order(bool strict, std::span<const std::int64_t> sizes, std::span<const T> values) {
  for (std::size_t i = 1; i < values.size(); ++i) {
    const bool in_order = strict ? values[i - 1] < values[i] : values[i - 1] <= values[i];
    if (!in_order)
      return ValueFault{strict ? "each element above the one before it" : "no element below the one before it",
                        fmt::format("{} after {}", at(sizes, i, values[i]), values[i - 1])};
  }
  return std::nullopt;
}

template <typename T>
std::optional<ValueFault> check_symmetry(std::span<const std::int64_t> sizes, std::span<const T> values) {
  if (sizes.size() != 2 || sizes[0] != sizes[1]) return ValueFault{"a square matrix", "another shape"};
  const auto size = static_cast<std::size_t>(sizes[0]);
  double largest = 0;
  for (const T value : values) largest = std::max(largest, std::abs(static_cast<double>(value)));
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const T value = values[i * size + j], mirror = values[j * size + i];
      if (std::abs(static_cast<double>(value) - static_cast<double>(mirror)) > kSymmetryTolerance * largest)
        return ValueFault{"a symmetric matrix",
                          fmt::format("{}, {} opposite it", at(sizes, i * size + j, value), mirror)};
    }
  return std::nullopt;
}

template <typename T>
std::optional<ValueFault> check_finite(std::span<const std::int64_t> sizes, std::span<const T> values) {
  if constexpr (std::is_floating_point_v<T>)
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i])) return ValueFault{"finite numbers", at(sizes, i, values[i])};
  return std::nullopt;
}

template <typename T>
std::optional<ValueFault> check_constraint(const Constraint& constraint, std::span<const std::int64_t> sizes,
                                           std::span<const T> values, const SymbolSizes& sizes_known) {
  if (constraint.kind == Kind::kSymmetric) return check_symmetry(sizes, values);
  if (constraint.kind == Kind::kAscending || constraint.kind == Kind::kIncreasing)
    return check_order(constraint.kind == Kind::kIncreasing, sizes, values);
  return check_elements(constraint, sizes, values, sizes_known);
}

template <typename T>
std::optional<ValueFault> check_numbers(std::span<const Constraint> constraints, std::span<const std::int64_t> sizes,
                                        std::span<const T> values, const SymbolSizes& sizes_known) {
  if (auto fault = check_finite(sizes, values)) return fault;
  for (const Constraint& constraint : constraints)
    if (auto fault = check_constraint(constraint, sizes, values, sizes_known)) return fault;
  return std::nullopt;
}

std::optional<ValueFault> check_text(std::span<const Constraint> constraints, const std::string& text) {
  for (const Constraint& constraint : constraints) {
    const bool is_listed = ("|" + constraint.argument + "|").find("|" + text + "|") != std::string::npos;
    if (constraint.kind != Kind::kOneOf || is_listed) continue;
    std::string expected = "\"" + constraint.argument + "\"";
    for (std::size_t bar = 0; (bar = expected.find('|', bar)) != std::string::npos; bar += 6)
      expected.replace(bar, 1, "\" or \"");
    return ValueFault{expected, "\"" + text + "\""};
  }
  return std::nullopt;
}

struct AttributeShape {
  ElementType type;
  bool is_scalar;
  std::size_t count;
};

AttributeShape shape_of(const AttributeValue& value) {
  return std::visit(
      [](const auto& held) -> AttributeShape {
        using T = std::decay_t<decltype(held)>;
        if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>)
          return {kElementType<T>, true, 1};
        else
          return {kElementType<typename T::value_type>, false, held.size()};
      },
      value);
}

std::string describe(ElementType type, bool is_scalar, std::string_view count) {
  if (is_scalar) return type == ElementType::kString ? "a string" : fmt::format("one {}", name_of(type));
  return fmt::format("{} {} elements", count, name_of(type));
}

std::optional<ValueFault> check_shape(const AttributeSchema& schema, const AttributeShape& shape) {
  const bool is_scalar = schema.dims.empty();
  const bool any_count = !is_scalar && schema.dims_text == "*";
  const auto count = is_scalar || any_count ? shape.count : static_cast<std::size_t>(schema.dims.front().factor);
  if (shape.type == schema.type && shape.is_scalar == is_scalar && shape.count == count) return std::nullopt;
  return ValueFault{describe(schema.type, is_scalar, any_count ? "any number of" : fmt::format("{}", count)),
                    describe(shape.type, shape.is_scalar, fmt::format("{}", shape.count))};
}

template <typename T>
std::span<const T> as_span(const void* data, std::size_t count) {
  return {static_cast<const T*>(data), count};
}

}  // namespace

std::optional<ValueFault> check_values(const DatasetSchema& schema, std::span<const std::int64_t> sizes,
                                       const void* data, const SymbolSizes& sizes_known) {
  std::size_t count = 1;
  for (const std::int64_t size : sizes) count *= static_cast<std::size_t>(size);
  switch (schema.type) {
    case ElementType::kFloat64:
      return check_numbers(schema.constraints, sizes, as_span<double>(data, count), sizes_known);
    case ElementType::kFloat32:
      return check_numbers(schema.constraints, sizes, as_span<float>(data, count), sizes_known);
    case ElementType::kInt32:
      return check_numbers(schema.constraints, sizes, as_span<std::int32_t>(data, count), sizes_known);
    case ElementType::kUint8:
      return check_numbers(schema.constraints, sizes, as_span<std::uint8_t>(data, count), sizes_known);
    default:
      throw std::logic_error(schema.path + ": no dataset has this type");
  }
}

std::optional<ValueFault> check_value(const AttributeSchema& schema, const AttributeValue& value,
                                      const SymbolSizes& sizes_known) {
  if (auto fault = check_shape(schema, shape_of(value))) return fault;
  return std::visit(
      [&](const auto& held) -> std::optional<ValueFault> {
        using T = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<T, std::string>)
          return check_text(schema.constraints, held);
        else if constexpr (std::is_arithmetic_v<T>)
          return check_numbers(schema.constraints, {}, std::span<const T>(&held, 1), sizes_known);
        else if constexpr (std::is_same_v<T, std::vector<std::string>>)
          return std::nullopt;
        else {
          const std::int64_t size = static_cast<std::int64_t>(held.size());
          return check_numbers(schema.constraints, {&size, 1}, std::span<const typename T::value_type>(held),
                               sizes_known);
        }
      },
      value);
}

}  // namespace exmat
