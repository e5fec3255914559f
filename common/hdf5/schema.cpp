#include "common/hdf5/schema.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <utility>

#include "common/core/plain_json.h"

namespace exmat {
namespace {

constexpr std::string_view kAnySize = "*";

struct TypeInfo {
  ElementType type;
  std::string_view name;
  std::size_t size;
};
constexpr std::array kTypes = {
    TypeInfo{ElementType::kFloat64, "float64", 8}, TypeInfo{ElementType::kFloat32, "float32", 4},
    TypeInfo{ElementType::kInt64, "int64", 8},     TypeInfo{ElementType::kInt32, "int32", 4},
    TypeInfo{ElementType::kUint32, "uint32", 4},   TypeInfo{ElementType::kUint8, "uint8", 1},
    TypeInfo{ElementType::kString, "string", 0}};

const TypeInfo& info_of(ElementType type) {
  return *std::find_if(kTypes.begin(), kTypes.end(), [type](const TypeInfo& info) { return info.type == type; });
}

// The pairs (i, j), i >= j, of v: v (v + 1) / 2, or more than any array has.
std::int64_t pair_count(std::int64_t v) {
  constexpr std::int64_t kLimit = 2'000'000'000;
  return v < kLimit ? v * (v + 1) / 2 : std::numeric_limits<std::int64_t>::max();
}

std::int64_t one_more(std::int64_t v) { return v + 1; }

// Symbols that follow from another, which is bound before them.
struct DerivedSymbol {
  std::string_view name, from;
  std::int64_t (*value)(std::int64_t);
};
constexpr std::array kDerivedSymbols = {DerivedSymbol{"R", "r", pair_count}, DerivedSymbol{"Q", "R", pair_count},
                                        DerivedSymbol{"P+1", "P", one_more}};

constexpr std::array<std::pair<Use, std::string_view>, 7> kUses = {{{Use::kStep, "step"},
                                                                    {Use::kPositions, "positions"},
                                                                    {Use::kFullSpace, "full_space"},
                                                                    {Use::kLook, "look"},
                                                                    {Use::kPlaces, "places"},
                                                                    {Use::kDraw, "draw"},
                                                                    {Use::kInspect, "inspect"}}};

constexpr std::array<std::pair<Constraint::Kind, std::string_view>, 11> kConstraints = {
    {{Constraint::Kind::kPositive, "positive"},
     {Constraint::Kind::kNonNegative, "non_negative"},
     {Constraint::Kind::kUnitInterval, "unit_interval"},
     {Constraint::Kind::kPoisson, "poisson"},
     {Constraint::Kind::kFlag, "flag"},
     {Constraint::Kind::kIndex, "index"},
     {Constraint::Kind::kAscending, "ascending"},
     {Constraint::Kind::kIncreasing, "increasing"},
     {Constraint::Kind::kSymmetric, "symmetric"},
     {Constraint::Kind::kOneOf, "one_of"},
     {Constraint::Kind::kMayBeEmpty, "may_be_empty"}}};

ElementType parse_type(const std::string& name) {
  const auto found =
      std::find_if(kTypes.begin(), kTypes.end(), [&](const TypeInfo& info) { return info.name == name; });
  if (found == kTypes.end()) throw std::logic_error("unknown type " + name);
  return found->type;
}

Use parse_use(const std::string& name) {
  const auto found = std::find_if(kUses.begin(), kUses.end(), [&](const auto& use) { return use.second == name; });
  if (found == kUses.end()) throw std::logic_error("unknown use " + name);
  return found->first;
}

Constraint parse_constraint(const std::string& text) {
  const auto colon = text.find(':');
  const std::string name = text.substr(0, colon);
  const auto found = std::find_if(kConstraints.begin(), kConstraints.end(),
                                  [&](const auto& constraint) { return constraint.second == name; });
  if (found == kConstraints.end()) throw std::logic_error("unknown constraint " + text);
  return {found->first, colon == std::string::npos ? "" : text.substr(colon + 1), text};
}

Extent parse_extent(const std::string& word) {
  Extent extent;
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, extent.factor);
  extent.symbol.assign(result.ptr, end);
  return extent;
}

std::vector<Extent> parse_dims(const std::string& text) {
  std::vector<Extent> dims;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(' ', begin), text.size());
    dims.push_back(parse_extent(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return dims;
}

// Members that attributes and datasets have in common.
template <typename Entry>
void parse_value(const PlainJson& json, Entry& entry) {
  entry.type = parse_type(json.at("type").text());
  entry.dims_text = json.at("dims").text();
  entry.dims = parse_dims(entry.dims_text);
  entry.units = json.at("units").text();
  entry.description = json.at("description").text();
  for (const std::string& text : json.at("constraints").texts()) entry.constraints.push_back(parse_constraint(text));
}

AttributeSchema parse_attribute(const PlainJson& json) {
  AttributeSchema attribute;
  attribute.name = json.at("name").text();
  parse_value(json, attribute);
  return attribute;
}

GroupSchema parse_group(const PlainJson& json) {
  GroupSchema group;
  group.path = json.at("path").text();
  group.group = json.at("group").text();
  group.description = json.at("description").text();
  for (const PlainJson& attribute : json.at("attributes").items())
    group.attributes.push_back(parse_attribute(attribute));
  if (const PlainJson* const symbols = json.find("symbols")) group.symbols = symbols->texts();
  if (const PlainJson* const holds = json.find("holds")) group.holds = holds->texts();
  return group;
}

DatasetSchema parse_dataset(const PlainJson& json) {
  DatasetSchema dataset;
  dataset.path = json.at("path").text();
  dataset.group = json.at("group").text();
  dataset.use = parse_use(json.at("use").text());
  parse_value(json, dataset);
  return dataset;
}

// "/datasets/7 (/modal/basis)" in front of what is wrong there.
template <typename Entry, typename Parse>
std::vector<Entry> parse_list(const PlainJson& json, const char* member, Parse parse) {
  std::vector<Entry> entries;
  for (const PlainJson& entry : json.at(member).items()) {
    try {
      entries.push_back(parse(entry));
    } catch (const std::exception& error) {
      throw std::logic_error(fmt::format("schema /{}/{}: {}", member, entries.size(), error.what()));
    }
  }
  return entries;
}

std::string folder_of(std::string_view path) { return std::string(path.substr(0, path.rfind('/'))); }

// The groups that each group holds, as entries of their own.
void expand_holds(FileSchema& schema) {
  std::vector<GroupSchema> groups;
  for (const GroupSchema& holder : schema.groups) {
    groups.push_back(holder);
    for (const std::string& held : holder.holds) {
      GroupSchema group = schema.group(held);
      group.like = std::exchange(group.path, holder.path + held);
      group.group = holder.group;
      groups.push_back(std::move(group));
    }
  }
  schema.groups = std::move(groups);
  std::vector<DatasetSchema> added;
  for (const GroupSchema& group : schema.groups)
    for (const DatasetSchema& dataset : schema.datasets) {
      if (group.like.empty() || folder_of(dataset.path) != group.like) continue;
      DatasetSchema& copy = added.emplace_back(dataset);
      copy.path = group.path + dataset.path.substr(group.like.size());
      copy.group = group.group;
    }
  std::ranges::move(added, std::back_inserter(schema.datasets));
}

template <typename Entry>
const Entry& find_by_path(const std::vector<Entry>& entries, std::string_view path) {
  const auto found =
      std::find_if(entries.begin(), entries.end(), [path](const Entry& entry) { return entry.path == path; });
  if (found == entries.end()) throw std::logic_error(fmt::format("{} is not in the schema", path));
  return *found;
}

}  // namespace

std::string_view name_of(ElementType type) { return info_of(type).name; }

std::size_t size_of(ElementType type) { return info_of(type).size; }

std::string_view name_of(Use use) {
  return std::find_if(kUses.begin(), kUses.end(), [use](const auto& entry) { return entry.first == use; })->second;
}

const DatasetSchema& FileSchema::dataset(std::string_view path) const { return find_by_path(datasets, path); }

const GroupSchema& FileSchema::group(std::string_view path) const { return find_by_path(groups, path); }

FileSchema parse_file_schema(std::string_view text) {
  const PlainJson json = PlainJson::parse(text);
  FileSchema schema;
  schema.format = json.at("format").text();
  schema.format_version = static_cast<std::int64_t>(json.at("format_version").number());
  schema.description = json.at("description").text();
  for (const auto& [name, meaning] : json.at("symbols").members()) schema.symbols.emplace_back(name, meaning.text());
  schema.attributes = parse_list<AttributeSchema>(json, "attributes", parse_attribute);
  schema.groups = parse_list<GroupSchema>(json, "groups", parse_group);
  schema.datasets = parse_list<DatasetSchema>(json, "datasets", parse_dataset);
  expand_holds(schema);
  return schema;
}

std::string fill_name(std::string_view schema_path, std::string_view placeholder, std::string_view name) {
  std::string path(schema_path);
  const auto at = path.find(placeholder);
  if (at != std::string::npos) path.replace(at, placeholder.size(), name);
  return path;
}

bool is_single(std::string_view schema_path) { return schema_path.find('{') == std::string_view::npos; }

void SymbolSizes::set(const std::string& symbol, std::int64_t value, std::string bound_by) {
  bindings_[symbol] = {value, std::move(bound_by)};
  bind_derived();
}

void SymbolSizes::forget(std::span<const std::string> symbols) {
  for (const std::string& symbol : symbols) bindings_.erase(symbol);
  for (const auto& [name, from, value] : kDerivedSymbols)
    if (find(from) == nullptr) bindings_.erase(std::string(name));
}

void SymbolSizes::bind_derived() {
  for (const auto& [name, from, value] : kDerivedSymbols)
    if (const Binding* known = find(from)) bindings_[std::string(name)] = {value(known->value), known->bound_by};
}

const SymbolSizes::Binding* SymbolSizes::find(std::string_view symbol) const {
  const auto found = bindings_.find(symbol);
  return found == bindings_.end() ? nullptr : &found->second;
}

std::vector<std::int64_t> SymbolSizes::evaluate(std::span<const Extent> dims) const {
  std::vector<std::int64_t> sizes;
  for (const Extent& extent : dims) {
    const Binding* binding = find(extent.symbol);
    if (!extent.symbol.empty() && binding == nullptr) throw std::logic_error("size " + extent.symbol + " is not known");
    sizes.push_back(extent.symbol.empty() ? extent.factor : extent.factor * binding->value);
  }
  return sizes;
}

std::optional<std::string> SymbolSizes::bind(std::span<const Extent> dims, std::span<const std::int64_t> sizes,
                                             const std::string& bound_by) {
  if (dims.size() != sizes.size()) return describe(dims);
  std::map<std::string, Binding, std::less<>> added;
  for (std::size_t axis = 0; axis < dims.size(); ++axis) {
    const auto& [factor, symbol] = dims[axis];
    if (symbol == kAnySize) continue;
    const Binding* known = find(symbol);
    if (known == nullptr && added.contains(symbol)) known = &added[symbol];
    const bool fits = symbol.empty()     ? sizes[axis] == factor
                      : known != nullptr ? sizes[axis] == factor * known->value
                                         : sizes[axis] % factor == 0;
    if (!fits) return describe(dims);
    if (!symbol.empty() && known == nullptr) added[symbol] = {sizes[axis] / factor, bound_by};
  }
  bindings_.merge(added);
  bind_derived();
  return std::nullopt;
}

std::string SymbolSizes::describe(std::span<const Extent> dims) const {
  std::vector<std::string> words, notes;
  for (const auto& [factor, symbol] : dims) {
    const std::string word =
        symbol.empty() ? std::to_string(factor) : (factor == 1 ? "" : std::to_string(factor)) + symbol;
    words.push_back(word);
    const Binding* binding = find(symbol);
    const std::string note =
        binding == nullptr ? "" : fmt::format("{} = {} from {}", symbol, binding->value, binding->bound_by);
    if (!note.empty() && std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(note);
  }
  if (words.empty()) return "a scalar";
  std::string text = fmt::format("{}", fmt::join(words, " x "));
  if (!notes.empty()) text += fmt::format(" ({})", fmt::join(notes, ", "));
  return text;
}

}  // namespace exmat
