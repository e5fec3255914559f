// Softness of bodies of linear tets and of smoothed elements beside quadratic tets of a fine mesh of the same shape.
// Renews the tables of docs/studies/stiffness.md, all or those that are named:
//   exmat-stiffness-benchmark PAGE.md [shapes] [calculix] [loads] [cages]

#include <algorithm>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <utility>

#include "common/core/error.h"
#include "tests/benchmark/stiffness/shapes.h"

namespace exmat::benchmarks {
namespace {

void renew(const std::string& page, const Table& table) {
  std::ifstream in(page);
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::size_t begin = text.find(table.head), end = text.find("\n\n", begin);
  if (begin == std::string::npos || end == std::string::npos)
    throw InputError({page, "", "a table that begins with " + table.head, "none", ""});
  text.replace(begin, end + 1 - begin, table.head + table.rows);
  std::ofstream(page) << text;
}

}  // namespace
}  // namespace exmat::benchmarks

int main(int argc, char** argv) {
  using namespace exmat::benchmarks;
  const std::pair<std::string, std::function<std::optional<Table>()>> tables[] = {
      {"shapes", shape_table}, {"calculix", calculix_table}, {"loads", load_table}, {"cages", cage_table}};
  for (const auto& [name, make] : tables) {
    if (argc > 2 && std::find(argv + 2, argv + argc, name) == argv + argc) continue;
    if (const std::optional<Table> table = make()) {
      fmt::print("{}{}", table->head, table->rows);
      renew(argv[1], *table);
    } else {
      fmt::print("{}: left as it was, its program is not there\n", name);
    }
  }
}
