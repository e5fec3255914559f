#include <algorithm>
#include <fmt/format.h>
#include <functional>
#include <numeric>
#include <optional>

#include "common/bundle/bundle.h"
#include "common/bundle/bundle_sink.h"
#include "common/bundle/fields.h"
#include "common/bundle/file_schemas.h"
#include "common/core/atomic_file.h"
#include "common/core/error.h"
#include "common/hdf5/hdf5_file.h"
#include "common/hdf5/schema.h"
#include "common/hdf5/value_checks.h"

namespace exmat {
namespace {

// Sizes of the dataset that holds a matrix of rows x cols: the last is cols, the product of the others rows.
std::vector<std::int64_t> solve_sizes(std::span<const Extent> dims, const ArrayView& view, const SymbolSizes& known) {
  if (dims.size() == 1) return {view.rows * view.cols};
  const Extent& last = dims.back();
  std::vector<std::int64_t> sizes;
  std::int64_t product = 1;
  std::optional<std::size_t> unknown;
  for (std::size_t axis = 0; axis + 1 < dims.size(); ++axis) {
    const auto& [factor, symbol] = dims[axis];
    const auto* binding = known.find(symbol);
    if (!symbol.empty() && symbol != last.symbol && binding == nullptr && !unknown) {
      unknown = axis;
      sizes.push_back(0);
      continue;
    }
    const std::int64_t value = symbol.empty() ? 1 : symbol == last.symbol ? view.cols / last.factor : binding->value;
    sizes.push_back(factor * value);
    product *= sizes.back();
  }
  if (unknown) sizes[*unknown] = product == 0 ? 0 : view.rows / product;
  sizes.push_back(view.cols);
  return sizes;
}

class BundleWriter {
 public:
  explicit BundleWriter(BundleSink& sink) : sink_(sink) {}

  void group(std::string_view schema_path, std::string_view path) {
    schema_path_ = schema_path;
    path_ = path;
    if (schema_path_ == "/") return;
    const GroupSchema& schema = bundle_schema().group(schema_path_);
    sizes_.forget(schema.symbols);
    sink_.group(schema, path_);
  }

  template <typename T>
  void attribute(std::string_view name, const T& member) {
    write_value(name, to_attribute(member));
  }

  template <typename T>
  void dataset(std::string_view name, const T& member) {
    write_array(name, view_of(member));
  }

 private:
  void write_value(std::string_view name, const AttributeValue& value) {
    const auto& attributes =
        schema_path_ == "/" ? bundle_schema().attributes : bundle_schema().group(schema_path_).attributes;
    const auto schema = std::ranges::find(attributes, name, &AttributeSchema::name);
    if (schema == attributes.end())
      throw std::logic_error(fmt::format("{}@{} is not in the schema", schema_path_, name));
    if (const auto fault = check_value(*schema, value, sizes_)) refuse(fmt::format("{}@{}", path_, name), *fault);
    sink_.attribute(path_, schema->name, value);
  }

  void write_array(std::string_view name, const ArrayView& view) {
    const DatasetSchema& schema = bundle_schema().dataset(fmt::format("{}/{}", schema_path_, name));
    const std::string path = fmt::format("{}/{}", path_, name);
    const auto sizes = solve_sizes(schema.dims, view, sizes_);
    const std::int64_t count = std::accumulate(sizes.begin(), sizes.end(), std::int64_t{1}, std::multiplies<>());
    const auto expected = sizes_.bind(schema.dims, sizes, path);
    if (expected || count != view.rows * view.cols)
      refuse(path, {expected.value_or(fmt::format("{}", fmt::join(sizes, " x "))),
                    fmt::format("a matrix of {} x {}", view.rows, view.cols)});
    if (const auto fault = check_values(schema, sizes, view.data, sizes_)) refuse(path, *fault);
    sink_.dataset(schema, path, sizes, view.data);
  }

  [[noreturn]] void refuse(const std::string& path, const ValueFault& fault) const {
    throw WorkError("cannot write " + to_string({sink_.name(), path, fault.expected, fault.found, ""}));
  }

  BundleSink& sink_;
  SymbolSizes sizes_;
  std::string schema_path_;
  std::string path_;
};

// The groups that a model holds and the bytes of their datasets.
class GroupLister {
 public:
  struct Group {
    std::string name;
    std::size_t bytes = 0;
  };

  explicit GroupLister(const ReducedModel& model) { visit_fields(model, *this); }

  void group(std::string_view schema_path, std::string_view) {
    const bool is_top = schema_path != "/" && schema_path.find('/', 1) == std::string_view::npos;
    if (is_top) groups.push_back({std::string(schema_path.substr(1)), 0});
  }
  template <typename T>
  void attribute(std::string_view, const T&) {}
  template <typename T>
  void dataset(std::string_view, const T& member) {
    const ArrayView view = view_of(member);
    groups.back().bytes += static_cast<std::size_t>(view.rows * view.cols) * size_of(view.type);
  }

  std::vector<Group> groups;
};

// The root attribute features.
std::vector<std::string> features_of(const ReducedModel& model, bool constrained) {
  const GroupLister lister(model);
  std::vector<std::string> features;
  for (const auto& group : lister.groups) features.push_back(group.name);
  features.emplace_back(constrained ? "constrained" : "free");
  return features;
}

class Hdf5Sink : public BundleSink {
 public:
  explicit Hdf5Sink(Hdf5File& file) : file_(file) {}

  const std::string& name() const override { return file_.name(); }
  void group(const GroupSchema& schema, const std::string& path) override { write_group(file_, schema, path); }
  void attribute(const std::string& object, const std::string& name, const AttributeValue& value) override {
    file_.write_attribute(object, name, value);
  }
  void dataset(const DatasetSchema& schema, const std::string& path, std::span<const std::int64_t> sizes,
               const void* data) override {
    write_dataset(file_, schema, path, sizes, data);
  }

 private:
  Hdf5File& file_;
};

}  // namespace

void write_fields(const ReducedModel& model, BundleSink& sink) {
  const bool constrained = model.object && (model.object->fixed.array() != 0).any();
  sink.attribute("/", "format", bundle_schema().format);
  sink.attribute("/", "format_version", bundle_schema().format_version);
  sink.attribute("/", "features", features_of(model, constrained));
  sink.attribute("/", "constrained", std::int64_t{constrained ? 1 : 0});
  BundleWriter writer(sink);
  visit_fields(model, writer);
}

void write_bundle(const ReducedModel& model, const std::filesystem::path& path) {
  AtomicFile output(path);
  auto file = Hdf5File::create(output.temporary(), path.string());
  Hdf5Sink sink(file);
  write_fields(model, sink);
  file.close();
  output.commit();
}

void fill_bytes(const ReducedModel& model, std::vector<LedgerEntry>& ledger) {
  const GroupLister lister(model);
  for (const auto& group : lister.groups) {
    const auto entry = std::ranges::find(ledger, group.name, &LedgerEntry::group);
    if (entry != ledger.end() && entry->included) entry->bytes = group.bytes;
  }
}

}  // namespace exmat
