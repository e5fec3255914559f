#include "tests/precompute/mesh_io/mesh_samples.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <numeric>
#include <unistd.h>

#include "tests/support/box_mesh.h"

namespace exmat::precompute::test {
namespace {

struct Punctuation : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

constexpr int kSoft = 7, kAll = 8;

std::string names_section() {
  return fmt::format("$PhysicalNames\n3\n2 5 \"bottom\"\n3 {} \"soft part\"\n3 {} \"all\"\n$EndPhysicalNames\n", kSoft,
                     kAll);
}

/// Sparse tags that do not grow with the index.
int node_tag(Eigen::Index vertex) { return static_cast<int>(1000 - 3 * vertex); }

struct PlainElement {
  int type, entity_dimension;
  std::vector<Eigen::Index> vertices;
};

const std::vector<PlainElement>& plain_elements() {
  static const std::vector<PlainElement> kElements{{15, 0, {0}}, {1, 1, {0, 1}}, {2, 2, {0, 1, 2}}};
  return kElements;
}

struct GroupedTet {
  int group, entity;
  Eigen::Index tet;
};

/// Version 2.2 has one element for each group that a tet is in.
std::vector<GroupedTet> grouped_tets(const MeshFile& mesh_file) {
  std::vector<GroupedTet> result;
  const auto soft_count = static_cast<Eigen::Index>(mesh_file.tet_sets.at("soft part").size());
  for (Eigen::Index t = 0; t < mesh_file.mesh.tet_count(); ++t) {
    if (t < soft_count) result.push_back({kSoft, 1, t});
    result.push_back({kAll, t < soft_count ? 1 : 2, t});
  }
  return result;
}

std::string joined_tags(const auto& vertices) {
  std::string text;
  for (const auto vertex : vertices) text += fmt::format(" {}", node_tag(vertex));
  return text;
}

}  // namespace

DecimalComma::DecimalComma() : before_(std::locale::global(std::locale(std::locale::classic(), new Punctuation))) {}

DecimalComma::~DecimalComma() { std::locale::global(before_); }

MeshFile sample_mesh(int cells) {
  MeshFile result;
  result.mesh = exmat::test::cube_grid(cells, 0.1);
  for (Eigen::Index v = 0; v < result.mesh.vertex_count(); ++v) {
    const double angle = static_cast<double>(v);
    result.mesh.vertices.row(v) += 0.01 * Eigen::RowVector3d(std::sin(angle), std::cos(angle), std::sin(2 * angle));
  }
  auto& all = result.tet_sets["all"];
  all.resize(static_cast<std::size_t>(result.mesh.tet_count()));
  std::iota(all.begin(), all.end(), 0);
  auto& soft = result.tet_sets["soft part"];
  soft.assign(all.begin(), all.begin() + result.mesh.tet_count() / 3);
  return result;
}

ByteWriter& ByteWriter::text(std::string_view text) {
  bytes_ += text;
  return *this;
}
ByteWriter& ByteWriter::integer(std::int32_t value) {
  append(&value, sizeof(value));
  return *this;
}
ByteWriter& ByteWriter::size(std::uint64_t value) {
  append(&value, sizeof(value));
  return *this;
}
ByteWriter& ByteWriter::real(double value) {
  append(&value, sizeof(value));
  return *this;
}

void ByteWriter::append(const void* value, std::size_t size) {
  std::string raw(static_cast<const char*>(value), size);
  if (swap_) std::reverse(raw.begin(), raw.end());
  bytes_ += raw;
}

std::string to_veg(const MeshFile& mesh_file) {
  const TetMesh& mesh = mesh_file.mesh;
  std::string text = fmt::format("# sample\n*VERTICES\n{} 3 0 0\n", mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    text += fmt::format("{} {} {} {}\n", v + 1, mesh.vertices(v, 0), mesh.vertices(v, 1), mesh.vertices(v, 2));
  text += fmt::format("\n*ELEMENTS\nTET\n{} 4 0\n", mesh.tet_count());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    text += fmt::format("{} {} {} {} {}\n", t + 1, mesh.tets(t, 0) + 1, mesh.tets(t, 1) + 1, mesh.tets(t, 2) + 1,
                        mesh.tets(t, 3) + 1);
  for (const auto& [name, tets] : mesh_file.tet_sets) {
    text += fmt::format("\n*SET {}\n", name);
    for (std::size_t i = 0; i < tets.size(); ++i) text += fmt::format("{}{}", tets[i] + 1, i % 8 == 7 ? ",\n" : ", ");
    text += "\n";
  }
  return text + "\n*MATERIAL SOFT\nENU, 1000, 6.0e6, 0.4\n\n*REGION\nallElements, SOFT\n";
}

std::string to_msh_22_text(const MeshFile& mesh_file) {
  const TetMesh& mesh = mesh_file.mesh;
  std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + names_section();
  text += fmt::format("$Nodes\n{}\n", mesh.vertex_count());
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
    text += fmt::format("{} {} {} {}\n", node_tag(v), mesh.vertices(v, 0), mesh.vertices(v, 1), mesh.vertices(v, 2));
  const auto tets = grouped_tets(mesh_file);
  text += fmt::format("$EndNodes\n$Elements\n{}\n", plain_elements().size() + tets.size());
  int number = 0;
  for (const auto& element : plain_elements())
    text += fmt::format("{} {} 2 5 1{}\n", ++number, element.type, joined_tags(element.vertices));
  for (const auto& [group, entity, tet] : tets)
    text += fmt::format("{} 4 2 {} {}{}\n", ++number, group, entity, joined_tags(mesh.tets.row(tet)));
  return text + "$EndElements\n";
}

std::string to_msh_22_binary(const MeshFile& mesh_file, bool swap) {
  const TetMesh& mesh = mesh_file.mesh;
  ByteWriter out(swap);
  out.text("$MeshFormat\n2.2 1 8\n").integer(1).text("\n$EndMeshFormat\n").text(names_section());
  out.text(fmt::format("$Nodes\n{}\n", mesh.vertex_count()));
  for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v) {
    out.integer(node_tag(v));
    for (int axis = 0; axis < 3; ++axis) out.real(mesh.vertices(v, axis));
  }
  const auto tets = grouped_tets(mesh_file);
  out.text(fmt::format("\n$EndNodes\n$Elements\n{}\n", plain_elements().size() + tets.size()));
  int number = 0;
  for (const auto& element : plain_elements()) {
    out.integer(element.type).integer(1).integer(2).integer(++number).integer(5).integer(1);
    for (const auto vertex : element.vertices) out.integer(node_tag(vertex));
  }
  out.integer(4).integer(static_cast<std::int32_t>(tets.size())).integer(2);
  for (const auto& [group, entity, tet] : tets) {
    out.integer(++number).integer(group).integer(entity);
    for (const auto vertex : mesh.tets.row(tet)) out.integer(node_tag(vertex));
  }
  return out.text("\n$EndElements\n").bytes();
}

std::string to_msh_41_text(const MeshFile& mesh_file) {
  const TetMesh& mesh = mesh_file.mesh;
  std::string text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n" + names_section();
  text += "$Entities\n1 1 1 2\n1 0 0 0 0 \n1 0 0 0 1 0 0 0 0 \n1 0 0 0 1 1 0 1 5 0 \n";
  text += fmt::format("1 0 0 0 1 1 1 2 {} {} 1 1 \n2 0 0 0 1 1 1 1 {} 1 -1 \n$EndEntities\n", kSoft, kAll, kAll);
  // The first node stands in a block of its own, with the parametric coordinate of a curve.
  text += fmt::format("$Nodes\n2 {} 1 1000\n1 1 1 1\n{}\n{} {} {} 0.5\n", mesh.vertex_count(), node_tag(0),
                      mesh.vertices(0, 0), mesh.vertices(0, 1), mesh.vertices(0, 2));
  text += fmt::format("3 1 0 {}\n", mesh.vertex_count() - 1);
  for (Eigen::Index v = 1; v < mesh.vertex_count(); ++v) text += fmt::format("{}\n", node_tag(v));
  for (Eigen::Index v = 1; v < mesh.vertex_count(); ++v)
    text += fmt::format("{} {} {}\n", mesh.vertices(v, 0), mesh.vertices(v, 1), mesh.vertices(v, 2));
  const auto soft_count = static_cast<Eigen::Index>(mesh_file.tet_sets.at("soft part").size());
  text += fmt::format("$EndNodes\n$Elements\n5 {} 1 999\n", 3 + mesh.tet_count());
  int number = 0;
  for (const auto& element : plain_elements())
    text += fmt::format("{} 1 {} 1\n{}{}\n", element.entity_dimension, element.type, ++number,
                        joined_tags(element.vertices));
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t) {
    if (t == 0) text += fmt::format("3 1 4 {}\n", soft_count);
    if (t == soft_count) text += fmt::format("3 2 4 {}\n", mesh.tet_count() - soft_count);
    text += fmt::format("{}{}\n", ++number, joined_tags(mesh.tets.row(t)));
  }
  return text + "$EndElements\n";
}

std::string to_msh_41_binary(const MeshFile& mesh_file, bool swap) {
  const TetMesh& mesh = mesh_file.mesh;
  const auto vertex_count = static_cast<std::uint64_t>(mesh.vertex_count());
  const auto tet_count = static_cast<std::uint64_t>(mesh.tet_count());
  const std::uint64_t soft_count = mesh_file.tet_sets.at("soft part").size();
  ByteWriter out(swap);
  const auto reals = [&out](const auto& values) {
    for (const double value : values) out.real(value);
  };
  const std::vector<double> box(6, 0.25), point(3, 0.25);
  out.text("$MeshFormat\n4.1 1 8\n").integer(1).text("\n$EndMeshFormat\n").text(names_section());
  out.text("$Entities\n").size(1).size(1).size(1).size(2).integer(1);
  reals(point);
  out.size(0).integer(1);
  reals(box);
  out.size(0).size(0).integer(1);
  reals(box);
  out.size(1).integer(5).size(0).integer(1);
  reals(box);
  out.size(2).integer(kSoft).integer(kAll).size(1).integer(1).integer(2);
  reals(box);
  out.size(1).integer(kAll).size(1).integer(-1).text("\n$EndEntities\n$Nodes\n");

  out.size(2)
      .size(vertex_count)
      .size(1)
      .size(1000)
      .integer(1)
      .integer(1)
      .integer(1)
      .size(1)
      .size(static_cast<std::uint64_t>(node_tag(0)));
  reals(mesh.vertices.row(0));
  out.real(0.5).integer(3).integer(1).integer(0).size(vertex_count - 1);
  for (Eigen::Index v = 1; v < mesh.vertex_count(); ++v) out.size(static_cast<std::uint64_t>(node_tag(v)));
  for (Eigen::Index v = 1; v < mesh.vertex_count(); ++v) reals(mesh.vertices.row(v));

  out.text("\n$EndNodes\n$Elements\n").size(5).size(3 + tet_count).size(1).size(999);
  std::uint64_t number = 0;
  const auto element = [&](const auto& vertices) {
    out.size(++number);
    for (const auto vertex : vertices) out.size(static_cast<std::uint64_t>(node_tag(vertex)));
  };
  for (const auto& plain : plain_elements()) {
    out.integer(plain.entity_dimension).integer(1).integer(plain.type).size(1);
    element(plain.vertices);
  }
  for (std::uint64_t t = 0; t < tet_count; ++t) {
    if (t == 0) out.integer(3).integer(1).integer(4).size(soft_count);
    if (t == soft_count) out.integer(3).integer(2).integer(4).size(tet_count - soft_count);
    element(mesh.tets.row(static_cast<Eigen::Index>(t)));
  }
  return out.text("\n$EndElements\n").bytes();
}

std::string to_medit(const MeshFile& mesh_file) {
  const TetMesh& mesh = mesh_file.mesh;
  std::string text =
      fmt::format("MeshVersionFormatted 2\n# sample\nDimension\n3\n\nVertices\n{}\n", mesh.vertex_count());
  for (const auto& x : mesh.vertices.rowwise()) text += fmt::format("{} {} {} 0\n", x[0], x[1], x[2]);
  text += "Corners 1\n1\nEdges\n1\n1 2 5\nTriangles\n1\n1 2 3 5\n";
  text += fmt::format("Tetrahedra\n{}\n", mesh.tet_count());
  const auto soft_count = static_cast<Eigen::Index>(mesh_file.tet_sets.at("soft part").size());
  for (Eigen::Index t = 0; t < mesh.tet_count(); ++t)
    text += fmt::format("{} {} {} {} {}\n", mesh.tets(t, 0) + 1, mesh.tets(t, 1) + 1, mesh.tets(t, 2) + 1,
                        mesh.tets(t, 3) + 1, t < soft_count ? kSoft : kAll);
  return text + "End\n";
}

// As text or as big-endian values, whatever their order in memory.
std::string to_vtk(const MeshFile& mesh_file, bool binary, bool offsets) {
  const TetMesh& mesh = mesh_file.mesh;
  ByteWriter out(std::endian::native == std::endian::little);
  const auto real = [&](double value) { binary ? out.real(value) : out.text(fmt::format("{} ", value)); };
  const auto integer = [&](Eigen::Index value) {
    binary ? out.integer(static_cast<std::int32_t>(value)) : out.text(fmt::format("{} ", value));
  };
  const auto size = [&](Eigen::Index value) {
    binary ? out.size(static_cast<std::uint64_t>(value)) : out.text(fmt::format("{} ", value));
  };
  out.text(fmt::format("# vtk DataFile Version {}\nsample\n{}\nDATASET UNSTRUCTURED_GRID\n", offsets ? "5.1" : "3.0",
                       binary ? "BINARY" : "ASCII"));
  out.text("FIELD FieldData 1\nTIME 1 1 double\n");
  real(0.25);
  out.text(fmt::format("\nPOINTS {} double\n", mesh.vertex_count()));
  for (const double x : mesh.vertices.reshaped<Eigen::RowMajor>()) real(x);
  // A triangle, then the tets.
  const Eigen::Index cells = mesh.tet_count() + 1;
  if (offsets) {
    out.text(fmt::format("\nMETADATA\nINFORMATION 0\n\nCELLS {} {}\nOFFSETS vtktypeint64\n", cells + 1, 4 * cells - 1));
    size(0);
    for (Eigen::Index cell = 0; cell < cells; ++cell) size(3 + 4 * cell);
    out.text("\nCONNECTIVITY vtktypeint64\n");
    for (int corner = 0; corner < 3; ++corner) size(corner);
    for (const auto corner : mesh.tets.reshaped<Eigen::RowMajor>()) size(corner);
  } else {
    out.text(fmt::format("\nCELLS {} {}\n", cells, 5 * cells - 1));
    for (const int value : {3, 0, 1, 2}) integer(value);
    for (const auto& tet : mesh.tets.rowwise()) {
      integer(4);
      for (const auto corner : tet) integer(corner);
    }
  }
  out.text(fmt::format("\nCELL_TYPES {}\n", cells));
  for (Eigen::Index cell = 0; cell < cells; ++cell) integer(cell == 0 ? 5 : 10);
  out.text(fmt::format("\nCELL_DATA {}\nSCALARS part int 1\nLOOKUP_TABLE default\n", cells));
  const auto soft_count = static_cast<Eigen::Index>(mesh_file.tet_sets.at("soft part").size());
  for (Eigen::Index cell = 0; cell < cells; ++cell) integer(cell <= soft_count ? kSoft : kAll);
  out.text(fmt::format("\nPOINT_DATA {}\nVECTORS displacement double\n", mesh.vertex_count()));
  for (const double x : mesh.vertices.reshaped<Eigen::RowMajor>()) real(x);
  return out.text("\n").bytes();
}

Sets named_sets(const MeshFile& mesh_file) { return mesh_file.tet_sets; }

Sets numbered_sets(const MeshFile& mesh_file, const std::string& prefix) {
  const auto& soft = mesh_file.tet_sets.at("soft part");
  const auto& all = mesh_file.tet_sets.at("all");
  return {{prefix + std::to_string(kSoft), soft},
          {prefix + std::to_string(kAll), {all.begin() + std::ssize(soft), all.end()}}};
}

const std::vector<Flavour>& flavours() {
  static const auto numbered = [](const MeshFile& mesh_file) { return numbered_sets(mesh_file, ""); };
  static const auto of_part = [](const MeshFile& mesh_file) { return numbered_sets(mesh_file, "part "); };
  static const std::vector<Flavour> kFlavours{
      {"Medit", ".mesh", to_medit, numbered},
      {"VtkText", ".vtk", [](const MeshFile& mesh_file) { return to_vtk(mesh_file, false, false); }, of_part},
      {"VtkBinary", ".vtk", [](const MeshFile& mesh_file) { return to_vtk(mesh_file, true, false); }, of_part},
      {"VtkOffsetsText", ".vtk", [](const MeshFile& mesh_file) { return to_vtk(mesh_file, false, true); }, of_part},
      {"VtkOffsetsBinary", ".vtk", [](const MeshFile& mesh_file) { return to_vtk(mesh_file, true, true); }, of_part},
      {"Veg", ".veg", to_veg},
      {"Msh22Text", ".msh", to_msh_22_text},
      {"Msh22Binary", ".msh", [](const MeshFile& mesh_file) { return to_msh_22_binary(mesh_file); }},
      {"Msh22Swapped", ".msh", [](const MeshFile& mesh_file) { return to_msh_22_binary(mesh_file, true); }},
      {"Msh41Text", ".msh", to_msh_41_text},
      {"Msh41Binary", ".msh", [](const MeshFile& mesh_file) { return to_msh_41_binary(mesh_file); }},
      {"Msh41Swapped", ".msh", [](const MeshFile& mesh_file) { return to_msh_41_binary(mesh_file, true); }}};
  return kFlavours;
}

std::string edited(std::string text, std::string_view from, std::string_view to) {
  const std::size_t begin = text.find(from);
  EXPECT_NE(begin, std::string::npos) << "nothing to replace: " << from;
  if (begin == std::string::npos) return text;
  EXPECT_EQ(text.find(from, begin + 1), std::string::npos) << "not unique: " << from;
  return text.replace(begin, from.size(), to);
}

Complaint complaint_of(const std::function<void()>& read) {
  try {
    read();
  } catch (const InputError& error) {
    return error.complaint();
  }
  ADD_FAILURE() << "no InputError";
  return {};
}

bool same_mesh(const TetMesh& a, const TetMesh& b) {
  return a.vertices.rows() == b.vertices.rows() && a.tets.rows() == b.tets.rows() && a.vertices == b.vertices &&
         a.tets == b.tets;
}

}  // namespace exmat::precompute::test
