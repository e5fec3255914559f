#include "common/core/input_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>
#include <string_view>
#include <utility>

#include "common/core/command_files.h"
#include "common/core/error.h"

namespace exmat {
namespace {

bool is_text(char c) { return (c >= 0x20 && c < 0x7f) || c == '\t' || c == '\r' || c == '\n'; }

struct Beginning {
  std::string_view bytes, kind, extension;
};
constexpr std::array<Beginning, 16> kBeginnings{{{"\x89HDF", "an HDF5 file (a bundle or a trajectory?)", ".h5"},
                                                 {"exmatpk\n", "a pack of a bundle", ".h5"},
                                                 {"glTF", "a glTF file (.glb)", ".glb"},
                                                 {"Kaydara FBX", "an FBX file", ".fbx"},
                                                 {"; FBX", "an FBX file", ".fbx"},
                                                 {"BLENDER", "a Blender file", ".blend"},
                                                 {"PK\3\4", "a ZIP archive (.npz, .3mf or .usdz?)", ".npz"},
                                                 {"\x93NUMPY", "a NumPy array", ".npy"},
                                                 {"\x89PNG\r\n", "a PNG image", ".png"},
                                                 {"\x1f\x8b", "a file that gzip packed", ".gz"},
                                                 {"$MeshFormat", "a Gmsh mesh", ".msh"},
                                                 {"# vtk DataFile", "a VTK file", ".vtk"},
                                                 {"MeshVersionFormatted", "a MEDIT mesh", ".mesh"},
                                                 {"ply", "a PLY surface", ".ply"},
                                                 {"solid", "an STL surface", ".stl"},
                                                 {"*VERTICES", "a .veg mesh", ".veg"}}};

/// Extensions of meshes and surfaces that are read.
constexpr std::array<std::string_view, 11> kRead{".glb", ".gltf", ".obj", ".ply",  ".stl", ".veg",
                                                 ".msh", ".node", ".ele", ".mesh", ".vtk"};

/// Files whose beginnings say nothing.
constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kExtensions{{{".obj", "an .obj surface"},
                                                                                    {".stl", "an STL surface"},
                                                                                    {".veg", "a .veg mesh"},
                                                                                    {".node", "a TetGen mesh"},
                                                                                    {".ele", "a TetGen mesh"}}};

constexpr std::string_view kFromBlender = "export it as .glb, as Blender does",
                           kFromMeshio = "convert it, as 'meshio convert IN OUT.msh' does",
                           kFromGmsh = "make tets of it, as 'gmsh -3 IN -o OUT.msh' does",
                           kFromPython =
                               "arrays go in from Python: exmat.precompute.write_mesh or exmat.precompute.bundle";
constexpr std::array<std::pair<std::string_view, std::string_view>, 28> kWays{
    {{".fbx", kFromBlender},
     {".blend", kFromBlender},
     {".dae", kFromBlender},
     {".3ds", kFromBlender},
     {".usd", kFromBlender},
     {".usda", kFromBlender},
     {".usdc", kFromBlender},
     {".usdz", kFromBlender},
     {".abc", kFromBlender},
     {".3mf", kFromBlender},
     {".off", kFromMeshio},
     {".vtu", kFromMeshio},
     {".xdmf", kFromMeshio},
     {".inp", kFromMeshio},
     {".unv", kFromMeshio},
     {".med", kFromMeshio},
     {".bdf", kFromMeshio},
     {".step", kFromGmsh},
     {".stp", kFromGmsh},
     {".iges", kFromGmsh},
     {".igs", kFromGmsh},
     {".brep", kFromGmsh},
     {".npz", kFromPython},
     {".npy", kFromPython},
     {".gz", "unpack it, as 'gunzip' does"},
     {".png", "an image is no mesh: name a mesh or a surface"},
     {".h5", "a bundle or a trajectory is no mesh: name the file that it was made of"},
     {".json", "an asset file is no mesh: name the file that it names"}}};

std::string_view second_of(std::span<const std::pair<std::string_view, std::string_view>> pairs,
                           std::string_view first) {
  for (const auto& [own, second] : pairs)
    if (own == first) return second;
  return {};
}

/// Null where the bytes begin as no known kind.
const Beginning* beginning_of(std::string_view bytes) {
  const auto found =
      std::ranges::find_if(kBeginnings, [&](const Beginning& one) { return bytes.starts_with(one.bytes); });
  return found == kBeginnings.end() ? nullptr : &*found;
}

/// Name of the encoding, for iconv, of text that is not in UTF-8; empty where nothing says so.
std::string utf16_of(std::string_view bytes) {
  const auto is_wide = [&](std::size_t at, std::size_t low) {
    return bytes.size() >= at + 2 && is_text(bytes[at + low]) && bytes[at + 1 - low] == '\0';
  };
  if ((bytes.starts_with("\xff\xfe") && is_wide(2, 0)) || (bytes.starts_with("\xfe\xff") && is_wide(2, 1)))
    return "UTF-16";
  if (is_wide(0, 0) && is_wide(2, 0)) return "UTF-16LE";
  return is_wide(0, 1) && is_wide(2, 1) ? "UTF-16BE" : "";
}

}  // namespace

std::string read_whole_file(const std::filesystem::path& file, const std::string& expected) {
  const auto refuse = [&](const std::string& found) { throw InputError({file.string(), "", expected, found, ""}); };
  check_input(file, expected);
  std::ifstream stream(file, std::ios::binary);
  if (!stream) refuse(std::string("a file that cannot be opened (") + std::strerror(errno) + ")");
  std::string bytes(std::filesystem::file_size(file), '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!stream) refuse("a file that cannot be read to its end");
  if (bytes.empty()) refuse("an empty file");
  return bytes;
}

std::string read_text_file(const std::filesystem::path& file, const std::string& expected) {
  constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
  std::string bytes = read_whole_file(file, expected);
  if (const std::string encoding = utf16_of(bytes); !encoding.empty())
    throw InputError({file.string(), "", expected, "text in " + encoding,
                      "save it as UTF-8, as iconv -f " + encoding + " -t UTF-8 does"});
  if (bytes.starts_with(kByteOrderMark) && bytes.size() > kByteOrderMark.size() &&
      is_text(bytes[kByteOrderMark.size()]))
    bytes.erase(0, kByteOrderMark.size());
  const bool is_binary = bytes.find('\0') != std::string::npos;
  if (!is_binary && bytes.find('\n') == std::string::npos) std::ranges::replace(bytes, '\r', '\n');
  return bytes;
}

std::string_view kind_of_file(const std::filesystem::path& file, std::string_view bytes) {
  if (const Beginning* known = beginning_of(bytes)) return known->kind;
  const std::size_t first = bytes.find_first_not_of(" \t\r\n");
  if (first != std::string_view::npos && bytes[first] == '{') return kJson;
  return second_of(kExtensions, lower_extension(file));
}

void refuse_other_kind(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  std::error_code ignored;
  if (std::ranges::find(kRead, extension) == kRead.end() || !std::filesystem::is_regular_file(file, ignored)) return;
  std::array<char, 32> bytes{};
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), bytes.size());
  const Beginning* known = beginning_of({bytes.data(), static_cast<std::size_t>(stream.gcount())});
  if (known == nullptr || known->extension == extension || (known->extension == ".glb" && extension == ".gltf")) return;
  const std::string_view way = second_of(kWays, known->extension);
  throw InputError({file.string(), "", "a " + extension + " file", std::string(known->kind),
                    way.empty() ? "name it with the extension " + std::string(known->extension) : std::string(way)});
}

std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

std::string way_from(const std::filesystem::path& file) { return std::string(second_of(kWays, lower_extension(file))); }

void refuse_extension(const std::filesystem::path& file, const std::string& expected, const std::string& advice) {
  const std::string extension = lower_extension(file);
  throw InputError({file.string(), "", expected, extension.empty() ? "no extension" : "'" + extension + "'",
                    advice.empty() ? way_from(file) : advice});
}

}  // namespace exmat
