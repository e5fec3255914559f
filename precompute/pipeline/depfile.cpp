#include "precompute/pipeline/depfile.h"

#include <set>
#include <string_view>

#include "common/core/error.h"

namespace exmat::precompute {
namespace {

std::string escaped(const std::string& name) {
  if (name.find_first_of("\n\r") != std::string::npos)
    throw InputError({name, "--depfile", "paths without line ends, which no depfile can hold", "one that has one",
                      "rename the file or its folder, or leave --depfile out"});
  std::string text;
  std::size_t backslashes = 0;  // just before this character
  for (const char c : name) {
    const bool special = c == ' ' || c == '\t' || c == '#' || c == ':';
    // Those before an escaped character would escape each other.
    if (special) text.append(backslashes + 1, '\\');
    if (c == '$') text += '$';
    text += c;
    backslashes = c == '\\' ? backslashes + 1 : 0;
  }
  return text;
}

}  // namespace

std::string depfile_text(const std::filesystem::path& target, const std::vector<std::filesystem::path>& files) {
  std::string text = escaped(target.string()) + ":";
  std::set<std::filesystem::path> seen;
  for (const auto& file : files)
    if (seen.insert(file).second) text += " \\\n  " + escaped(file.string());
  return text + "\n";
}

}  // namespace exmat::precompute
