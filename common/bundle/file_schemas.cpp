#include "common/bundle/file_schemas.h"

#include "common/config/embedded_schema.h"

namespace exmat {

const FileSchema& bundle_schema() {
  static const FileSchema schema = parse_file_schema(embedded_schema("bundle"));
  return schema;
}

const FileSchema& trajectory_schema() {
  static const FileSchema schema = parse_file_schema(embedded_schema("trajectory"));
  return schema;
}

}  // namespace exmat
