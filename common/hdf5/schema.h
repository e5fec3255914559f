#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace exmat {

// A file format as data, from a schema such as schemas/bundle.json: the one source of the field lists of writers and
// readers, and of docs/bundle_format.md.

/// Types of datasets and attributes; in the file always little-endian.
enum class ElementType { kFloat64, kFloat32, kInt64, kInt32, kUint32, kUint8, kString };

std::string_view name_of(ElementType type);
/// Bytes of one element; 0 for strings.
std::size_t size_of(ElementType type);

template <typename T>
inline constexpr ElementType kElementType = ElementType::kString;
template <>
inline constexpr ElementType kElementType<double> = ElementType::kFloat64;
template <>
inline constexpr ElementType kElementType<float> = ElementType::kFloat32;
template <>
inline constexpr ElementType kElementType<std::int64_t> = ElementType::kInt64;
template <>
inline constexpr ElementType kElementType<std::int32_t> = ElementType::kInt32;
template <>
inline constexpr ElementType kElementType<std::uint32_t> = ElementType::kUint32;
template <>
inline constexpr ElementType kElementType<std::uint8_t> = ElementType::kUint8;

/// Value of an attribute: a scalar or a flat array (sizes are the schema's business).
using AttributeValue = std::variant<std::int64_t, double, std::string, std::vector<std::int64_t>, std::vector<double>,
                                    std::vector<std::string>>;

/// One size of an array: factor times the value of a symbol ("3m"), or the factor alone ("9").
struct Extent {
  std::int64_t factor = 1;
  std::string symbol;
};

/// A rule on values. Numbers are finite besides.
struct Constraint {
  enum class Kind {
    kPositive,      ///< > 0
    kNonNegative,   ///< >= 0
    kUnitInterval,  ///< in [0, 1]
    kPoisson,       ///< in (-1, 0.5)
    kFlag,          ///< 0 or 1
    kIndex,         ///< in [0, value of the symbol `argument`)
    kAscending,     ///< no element below the one before it
    kIncreasing,    ///< each element above the one before it
    kSymmetric,     ///< a symmetric matrix
    kOneOf,         ///< a string among `argument`, separated by '|'
    kMayBeEmpty,    ///< unlike all others, an array may have no elements
  };
  Kind kind;
  std::string argument;
  std::string text;  ///< as in the schema, e.g. "index:n_t"
};

/// When the run time reads a dataset of a group that a scene needs.
enum class Use {
  kStep,       ///< to step
  kPositions,  ///< to write positions
  kFullSpace,  ///< to step in all vertices
  kLook,       ///< to export what is drawn
  kPlaces,     ///< to find the vertices that a scene names
  kDraw,       ///< to draw the body or its elements
  kInspect,    ///< never
};
std::string_view name_of(Use use);

struct AttributeSchema {
  std::string name;
  ElementType type;
  std::vector<Extent> dims;  ///< empty: a scalar
  std::string dims_text, units, description;
  std::vector<Constraint> constraints;
};

struct GroupSchema {
  std::string path;   ///< "/examples/{example}": one for each example; "/regions/{region}/examples", ... likewise
  std::string group;  ///< name in the ledger, e.g. "examples"
  std::string description;
  std::vector<AttributeSchema> attributes;
  std::vector<std::string> symbols;  ///< sizes that each group of this path has of its own
  std::vector<std::string> holds;    ///< paths of groups before this one, whose like it holds
  std::string like;                  ///< the path of the group that this one repeats; empty for most
};

struct DatasetSchema {
  std::string path;   ///< "/examples/{example}/reduced": one for each example
  std::string group;  ///< name in the ledger
  ElementType type;
  std::vector<Extent> dims;
  std::string dims_text, units, description;
  Use use = Use::kInspect;
  std::vector<Constraint> constraints;
};

/// A file format: attributes of the root, groups and datasets, in file order.
struct FileSchema {
  std::string format;
  std::int64_t format_version = 1;
  std::string description;
  std::vector<std::pair<std::string, std::string>> symbols;  ///< name and meaning
  std::vector<AttributeSchema> attributes;
  std::vector<GroupSchema> groups;
  std::vector<DatasetSchema> datasets;

  /// By schema path; std::logic_error where there is none.
  const DatasetSchema& dataset(std::string_view path) const;
  const GroupSchema& group(std::string_view path) const;
};

/// Throws std::logic_error (a fault of the build, not of an input) that names the entry.
FileSchema parse_file_schema(std::string_view json);

/// "/examples/{example}/reduced" with the placeholder's name filled in; other paths stay.
std::string fill_name(std::string_view schema_path, std::string_view placeholder, std::string_view name);

/// True if a path of the schema stands for one in the file, and no more.
bool is_single(std::string_view schema_path);

/// Values of symbols such as n and r, each with what gave it its value, for messages. With r come R = r (r + 1) / 2 and
/// Q = R (R + 1) / 2.
class SymbolSizes {
 public:
  struct Binding {
    std::int64_t value = 0;
    std::string bound_by;  ///< dataset path, or whatever else names the source
  };

  void set(const std::string& symbol, std::int64_t value, std::string bound_by);
  /// Forgets symbols and what follows from them.
  void forget(std::span<const std::string> symbols);
  /// Null where the symbol is not bound.
  const Binding* find(std::string_view symbol) const;

  /// Sizes of an array; std::logic_error if a symbol is not bound.
  std::vector<std::int64_t> evaluate(std::span<const Extent> dims) const;

  /// Compares the sizes of an array with `dims` and binds the symbols that are not bound yet. Returns what was
  /// expected, or nothing if the sizes fit: "3 x 20 (r = 20 from /modal/basis)".
  std::optional<std::string> bind(std::span<const Extent> dims, std::span<const std::int64_t> sizes,
                                  const std::string& bound_by);

 private:
  std::string describe(std::span<const Extent> dims) const;
  void bind_derived();

  std::map<std::string, Binding, std::less<>> bindings_;
};

}  // namespace exmat
