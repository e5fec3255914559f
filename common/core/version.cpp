#include "common/core/version.h"

namespace exmat {

std::string_view version() { return EXMAT_VERSION; }

}  // namespace exmat
