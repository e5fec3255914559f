#include "common/config/pose_file.h"

#include <cmath>
#include <fmt/format.h>
#include <string>
#include <string_view>

#include "common/core/error.h"
#include "common/core/input_file.h"
#include "common/core/number_limits.h"

namespace exmat {
namespace {

constexpr double kUnit = 1e-6;  // of the length of a quaternion

/// The numbers of a line; throws where it holds anything else.
std::vector<double> numbers_of(const std::string& line, const std::filesystem::path& file, const std::string& place) {
  std::vector<double> numbers;
  const char* at = line.c_str();
  for (;;) {
    while (*at == ' ' || *at == '\t' || *at == '\r') ++at;
    if (*at == '\0') return numbers;
    char* end = nullptr;
    const double number = std::strtod(at, &end);
    if (end == at || !is_near(number))
      throw InputError({file.string(), place, fmt::format("3 or 7 finite numbers of at most {:g}", kFarthest),
                        fmt::format("\"{}\"", line), ""});
    numbers.push_back(number);
    at = end;
  }
}

}  // namespace

std::vector<BodyPlace> read_poses(const std::filesystem::path& file) {
  const std::string text = read_text_file(file, "a text file of poses");
  std::vector<BodyPlace> places;
  std::size_t start = 0;
  for (int number = 1; start < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    const std::string line = text.substr(start, end - start);
    start = end + 1;
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    const std::string place = fmt::format("line {}", number);
    const std::vector<double> n = numbers_of(line, file, place);
    if (n.size() != 3 && n.size() != 7)
      throw InputError(
          {file.string(), place, "x y z, or x y z and a quaternion w x y z", fmt::format("{} numbers", n.size()), ""});
    BodyPlace& added = places.emplace_back();
    added.position = Eigen::Vector3d(n[0], n[1], n[2]);
    if (n.size() == 3) continue;
    const Eigen::Quaterniond turn(n[3], n[4], n[5], n[6]);
    if (!(std::abs(turn.norm() - 1) <= kUnit))
      throw InputError(
          {file.string(), place, "a quaternion of length 1", fmt::format("one of {:g}", turn.norm()), "write w x y z"});
    added.orientation = turn.normalized();
  }
  if (places.empty()) throw InputError({file.string(), "", "a line for each body", "none", ""});
  return places;
}

}  // namespace exmat
