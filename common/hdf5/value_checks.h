#pragma once

#include <optional>
#include <span>
#include <string>

#include "common/hdf5/schema.h"

namespace exmat {

/// Expected and found value, as in Complaint.
struct ValueFault {
  std::string expected;
  std::string found;
};

/// The first element of an array (with its index) that is not finite or breaks a constraint of the schema. kIndex is
/// checked where its symbol is bound in `sizes_known`. `data` holds the product of `sizes` elements of the schema's
/// type.
std::optional<ValueFault> check_values(const DatasetSchema& schema, std::span<const std::int64_t> sizes,
                                       const void* data, const SymbolSizes& sizes_known);

/// The same for an attribute, its type and size included.
std::optional<ValueFault> check_value(const AttributeSchema& schema, const AttributeValue& value,
                                      const SymbolSizes& sizes_known);

}  // namespace exmat
