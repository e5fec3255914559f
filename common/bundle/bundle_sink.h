#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "common/hdf5/schema.h"
#include "common/model/reduced_model.h"

namespace exmat {

/// Receives all that a bundle holds, a group before what is in it.
class BundleSink {
 public:
  virtual ~BundleSink() = default;

  /// As messages name it.
  virtual const std::string& name() const = 0;
  virtual void group(const GroupSchema& schema, const std::string& path) = 0;
  virtual void attribute(const std::string& object, const std::string& name, const AttributeValue& value) = 0;
  /// `data` holds the product of `sizes` elements of the schema's type.
  virtual void dataset(const DatasetSchema& schema, const std::string& path, std::span<const std::int64_t> sizes,
                       const void* data) = 0;
};

/// Writes the header and all fields that the model holds. Throws WorkError where they break the schema.
void write_fields(const ReducedModel& model, BundleSink& sink);

}  // namespace exmat
