#pragma once

#include <filesystem>
#include <functional>
#include <locale>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/error.h"
#include "precompute/mesh_io/mesh_file.h"
#include "tests/support/temporary_folder.h"

namespace exmat::precompute::test {

using exmat::test::TemporaryFolder;

/// A grid of `cells`^3 cubes with coordinates of 17 digits, and the tet sets "all" and, of the first third, "soft
/// part".
MeshFile sample_mesh(int cells);

/// Appends binary values, if `swap` in the byte order that is not this machine's.
class ByteWriter {
 public:
  explicit ByteWriter(bool swap = false) : swap_(swap) {}
  ByteWriter& text(std::string_view text);
  ByteWriter& integer(std::int32_t value);
  ByteWriter& size(std::uint64_t value);
  ByteWriter& real(double value);
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* value, std::size_t size);

  bool swap_;
  std::string bytes_;
};

/// While it lives, the global locale writes "1,5" and "1.000".
class DecimalComma {
 public:
  DecimalComma();
  ~DecimalComma();
  DecimalComma(const DecimalComma&) = delete;
  DecimalComma& operator=(const DecimalComma&) = delete;

 private:
  std::locale before_;
};

/// The mesh and its sets in each format, with a point, a line and a triangle besides the tets where the format has
/// them.
std::string to_veg(const MeshFile& mesh_file);
std::string to_msh_22_text(const MeshFile& mesh_file);
std::string to_msh_22_binary(const MeshFile& mesh_file, bool swap = false);
std::string to_msh_41_text(const MeshFile& mesh_file);
std::string to_msh_41_binary(const MeshFile& mesh_file, bool swap = false);

std::string to_medit(const MeshFile& mesh_file);
std::string to_vtk(const MeshFile& mesh_file, bool binary, bool offsets);

using Sets = std::map<std::string, std::vector<std::int32_t>>;
/// The sets as formats with names keep them.
Sets named_sets(const MeshFile& mesh_file);

struct Flavour {
  std::string name, extension;
  std::string (*write)(const MeshFile&);
  Sets (*sets)(const MeshFile&) = named_sets;  ///< the sets that the format keeps
};
/// Every format and encoding.
const std::vector<Flavour>& flavours();

/// `text` with its only occurrence of `from` replaced.
std::string edited(std::string text, std::string_view from, std::string_view to);

/// The complaint of the InputError that `read` throws.
Complaint complaint_of(const std::function<void()>& read);

/// Same vertices and tets, to the last bit.
bool same_mesh(const TetMesh& a, const TetMesh& b);

}  // namespace exmat::precompute::test
