#include <exmat/exmat.h>
#include <optional>

static_assert(__cplusplus == 201703L, "the guest's own standard");

int main() {
  const std::optional<int> size = static_cast<int>(sizeof(exmat_settings));
  return size.value() > 0 ? 0 : 1;
}
