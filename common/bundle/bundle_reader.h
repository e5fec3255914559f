#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/bundle/bundle.h"
#include "common/bundle/bundle_store.h"
#include "common/bundle/fields.h"
#include "common/hdf5/schema.h"
#include "common/model/reduced_model.h"

namespace exmat {

/// Reads a bundle's header when constructed, then what is asked of it. Every fault is an InputError that names the file
/// and the dataset, or, with `problems`, one more message there. Also the visitor of the field list (fields.h).
class BundleReader {
 public:
  BundleReader(const BundleInput& input, std::vector<ReadRecord>* record = nullptr,
               std::vector<std::string>* problems = nullptr);

  const BundleStore& file() const { return *file_; }
  const std::vector<std::string>& features() const { return features_; }
  bool constrained() const { return constrained_; }
  const SymbolSizes& sizes() const { return sizes_; }

  /// Ledger of the groups that the header lists, in bundle order.
  std::vector<LedgerEntry> listed_groups() const;
  /// Names of the groups in `folder`, /examples or a region's.
  std::vector<std::string> example_names(const std::string& folder) const;
  std::vector<std::string> region_names() const;

  ReducedModel read(const BundleRequest& request);
  /// Attribute of the root group.
  std::string text_attribute(const std::string& name) const;
  /// Reads an attribute of another group.
  template <typename T>
  void read_attribute(std::string_view schema_path, std::string_view path, std::string_view name, T& member) {
    group(schema_path, path);
    attribute(name, member);
  }
  /// Opens a dataset and checks its type and sizes, which binds its symbols; reads no data.
  std::unique_ptr<StoredArray> open_checked(const DatasetSchema& schema, const std::string& path);
  void note(const std::string& dataset, std::size_t bytes);
  /// Runs `check`; with `problems`, an InputError of it is noted there.
  void attempt(const std::function<void()>& check);

  void group(std::string_view schema_path, std::string_view path);

  template <typename T>
  void attribute(std::string_view name, T& member) {
    const AttributeSchema& schema = attribute_schema(name);
    attempt([&] { from_attribute(read_value(schema), member); });
  }

  template <typename T>
  void dataset(std::string_view name, T& member) {
    const DatasetSchema& schema = schema_of(name);
    if (!is_wanted(schema)) return;
    attempt([&] {
      const std::string path = path_ + "/" + std::string(name);
      const auto dataset = open_checked(schema, path);
      if (is_left_out(*dataset, schema)) return;
      const auto [rows, cols] = matrix_sizes(*dataset);
      read_checked(*dataset, schema, resized(member, rows, cols));
    });
  }

 private:
  void read_header();
  AttributeValue header_value(std::string_view name) const;
  const AttributeSchema& attribute_schema(std::string_view name) const;
  AttributeValue read_value(const AttributeSchema& schema);
  void require_group(const LedgerEntry& entry) const;
  const DatasetSchema& schema_of(std::string_view name) const;
  bool is_wanted(const DatasetSchema& schema) const;
  static std::pair<std::int64_t, std::int64_t> matrix_sizes(const StoredArray& dataset);
  bool is_left_out(const StoredArray& dataset, const DatasetSchema& schema) const;
  void read_checked(const StoredArray& dataset, const DatasetSchema& schema, void* memory);
  void check_model(const ReducedModel& model);
  void add_examples(const std::string& folder, ExampleSet& set) const;
  void add_regions(ReducedModel& model) const;
  void check_example_indices(const std::string& folder, const ExampleSet& set) const;
  void check_fixed_vertices(const ReducedModel& model) const;
  void check_marks(const ObjectData& object) const;
  void check_targets(const std::string& folder, const TargetTableData& targets);
  void check_exponents(const std::string& folder, const TargetTableData& targets) const;
  void check_target_knots(const std::string& folder, const TargetTableData& targets) const;
  void check_elements(const ReducedModel& model);
  void check_barycentric(const RowMatrix& rows) const;
  void check_skeleton(const SkeletonData& skeleton) const;
  void check_bones(const ReducedModel& model) const;
  void check_shifts(const ReducedModel& model) const;
  bool is_sound(const std::string& place) const { return sound_.contains(place); }
  [[noreturn]] void refuse(const std::string& place, const std::string& expected, const std::string& found,
                           const std::string& advice = "") const;

  std::unique_ptr<BundleStore> file_;
  std::vector<ReadRecord>* record_;
  std::vector<std::string>* problems_;
  std::vector<std::string> features_;
  bool constrained_ = false;

  BundleRequest request_;
  SymbolSizes sizes_;
  std::size_t bytes_opened_ = 0;  // of datasets, in memory
  std::set<std::string> sound_;   // datasets and attributes that were read and passed
  std::string schema_path_;
  std::string path_;
};

}  // namespace exmat
