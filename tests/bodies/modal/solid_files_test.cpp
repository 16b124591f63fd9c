// Meshes of solids in files: bulk data in its three forms of fields and Gmsh in its two versions are one mesh; what else stands there is
// told.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/mode_audit.hpp"
#include "bodies/modal/mode_cache.hpp"
#include "bodies/modal/node_sets.hpp"
#include "bodies/modal/solids.hpp"
#include "tests/bodies/modal/solid_samples.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using Eigen::Vector3d;

Vector3d skewed(const Vector3d& s) { return {2 * s.x() + 0.25 * s.y(), s.y() - 0.5, 0.5 * s.z() + 0.125 * s.x() * s.x()}; }
const char* card_of(SolidShape shape) {
  return shape == SolidShape::tetra10 ? "CTETRA" : shape == SolidShape::penta15 ? "CPENTA" : "CHEXA";
}

enum class Fields { free, small, large };
/// Fields of a card in lines of 8 (or 4) with continuations.
std::string card_text(const std::string& name, const std::vector<std::string>& fields, Fields form) {
  if (form == Fields::free) {
    std::string out = name;
    for (std::size_t i = 0; i < fields.size(); ++i) out += (i > 0 && i % 8 == 0 ? "\n," : ",") + fields[i];
    return out + "\n";
  }
  const std::size_t in_line = form == Fields::small ? 8 : 4, width = 64 / in_line;
  std::string out = fmt::format("{:<8}", name + (form == Fields::large ? "*" : ""));
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (i > 0 && i % in_line == 0) out += fmt::format("{0}\n{0:<8}", form == Fields::small ? "+C" : "*C");
    out += fmt::format("{:>{}}", fields[i], width);
  }
  return out + "\n";
}

std::string bulk_of(const SolidMesh& mesh, Fields form, const std::string& material = "7.0+10", const std::string& density = "2.7E3",
                    double scale = 1.0) {
  std::string out = "$ bulk data of a test\n";
  out += card_text("PSOLID", {"4", "9"}, form);
  out += card_text("MAT1", {"9", material, "", ".3", density}, form);
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i) {
    std::vector<std::string> fields = {fmt::format("{}", 10 * (i + 1)), ""};
    for (int a = 0; a < 3; ++a) fields.push_back(fmt::format("{:#.6g}", scale * mesh.nodes[i][a]).substr(0, 8));
    out += card_text("GRID", fields, form);
  }
  for (const SolidMesh::Element& e : mesh.elements) {
    std::vector<std::string> fields = {fmt::format("{}", e.number), "4"};
    for (const int i : e.nodes) fields.push_back(fmt::format("{}", 10 * (i + 1)));
    out += card_text(card_of(e.shape), fields, form);
  }
  return out + "ENDDATA\n";
}

/// Gmsh's number of a shape, and the places of its nodes in our order: its edges as its manual draws them.
std::pair<int, std::vector<int>> gmsh_order(SolidShape shape) {
  switch (shape) {
    case SolidShape::tetra10:
      return {11, {0, 1, 2, 3, 4, 5, 6, 7, 9, 8}};
    case SolidShape::hexa20:
      return {17, {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 10, 12, 14, 15, 16, 18, 19, 17}};
    case SolidShape::penta15:
      return {18, {0, 1, 2, 3, 4, 5, 6, 9, 7, 8, 10, 11, 12, 14, 13}};
    case SolidShape::hexa8:
      return {5, {0, 1, 2, 3, 4, 5, 6, 7}};
  }
  return {};
}

/// Nodes at x = 0 ... are those of the group "base", by points; the volume is "body".
std::string gmsh_of(const SolidMesh& mesh, bool modern, const std::vector<int>& base) {
  const auto [type, order] = gmsh_order(mesh.elements[0].shape);
  std::string out = fmt::format("$MeshFormat\n{} 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n0 7 \"base\"\n3 8 \"body\"\n$EndPhysicalNames\n",
                                modern ? "4.1" : "2.2");
  const std::size_t n = mesh.nodes.size(), m = mesh.elements.size();
  const auto place = [&](std::size_t i) {
    return fmt::format("{:.17g} {:.17g} {:.17g}\n", mesh.nodes[i].x(), mesh.nodes[i].y(), mesh.nodes[i].z());
  };
  const auto nodes = [&, &turn = order](const SolidMesh::Element& e) {
    std::vector<int> theirs(e.nodes.size());
    for (std::size_t k = 0; k < e.nodes.size(); ++k) theirs[static_cast<std::size_t>(turn[k])] = e.nodes[k] + 1;
    std::string text;
    for (const int i : theirs) text += fmt::format(" {}", i);
    return text + "\n";
  };
  if (modern) {
    out += "$Entities\n1 0 0 1\n1 0 0 0 1 7\n1 0 0 0 2 1 1 1 8 0\n$EndEntities\n";
    out += fmt::format("$Nodes\n1 {0} 1 {0}\n3 1 0 {0}\n", n);
    for (std::size_t i = 0; i < n; ++i) out += fmt::format("{}\n", i + 1);
    for (std::size_t i = 0; i < n; ++i) out += place(i);
    out += fmt::format("$EndNodes\n$Elements\n2 {} 1 {}\n0 1 15 {}\n", m + base.size(), m + base.size(), base.size());
    for (std::size_t i = 0; i < base.size(); ++i) out += fmt::format("{} {}\n", 1000 + i, base[i] + 1);
    out += fmt::format("3 1 {} {}\n", type, m);
    for (const SolidMesh::Element& e : mesh.elements) out += fmt::format("{}{}", e.number, nodes(e));
  } else {
    out += fmt::format("$Nodes\n{}\n", n);
    for (std::size_t i = 0; i < n; ++i) out += fmt::format("{} {}", i + 1, place(i));
    out += fmt::format("$EndNodes\n$Elements\n{}\n", m + base.size());
    for (std::size_t i = 0; i < base.size(); ++i) out += fmt::format("{} 15 2 7 1 {}\n", 1000 + i, base[i] + 1);
    for (const SolidMesh::Element& e : mesh.elements) out += fmt::format("{} {} 2 8 1{}", e.number, type, nodes(e));
  }
  return out + "$EndElements\n";
}

struct SolidFiles : testing::Test {
  TemporaryFolder dir;
  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(dir / name) << text;
    return dir / name;
  }
  Diagnostic refused(const std::string& name, const std::string& text) {
    try {
      const std::string path = write(name, text);
      const Located at{"modal.solid.mesh", {}};
      name.ends_with(".msh") ? read_gmsh(path, SolidModel::Units::si, at) : read_bulk_data(path, SolidModel::Units::si, at);
    } catch (const InputError& e) {
      return e.diagnostics().front();
    }
    return {};
  }
};

void expect_same(const SolidMesh& got, const SolidMesh& want, double tolerance, const char* what) {
  ASSERT_EQ(got.nodes.size(), want.nodes.size()) << what;
  ASSERT_EQ(got.elements.size(), want.elements.size()) << what;
  for (std::size_t i = 0; i < want.nodes.size(); ++i) EXPECT_LE((got.nodes[i] - want.nodes[i]).norm(), tolerance) << what;
  for (std::size_t i = 0; i < want.elements.size(); ++i) {
    EXPECT_EQ(got.elements[i].nodes, want.elements[i].nodes) << what << i;
    EXPECT_EQ(got.elements[i].shape, want.elements[i].shape);
    EXPECT_EQ(got.elements[i].number, want.elements[i].number);
  }
}

TEST_F(SolidFiles, OfAllFormsAreOneMesh) {
  for (const SolidShape shape : test::kSolidShapes) {
    const SolidMesh mesh = test::block(shape, {2, 1, 1}, skewed, {70e9, 0.3, 2700.0});
    for (const Fields form : {Fields::free, Fields::small, Fields::large}) {
      const SolidMesh got = read_bulk_data(write("a.bdf", bulk_of(mesh, form)), SolidModel::Units::si, {});
      expect_same(got, mesh, 1e-6, name_of(shape));
      ASSERT_EQ(got.materials.size(), 1u);
      EXPECT_EQ(got.materials[0].E, 70e9);
      EXPECT_EQ(got.materials[0].nu, 0.3);
      EXPECT_EQ(got.materials[0].rho, 2700.0);
      EXPECT_EQ(got.numbers[1], 20);
    }
    // The same in mm, t and MPa.
    const SolidMesh small =
        read_bulk_data(write("mm.bdf", bulk_of(mesh, Fields::large, "7.0+4", "2.7-9", 1e3)), SolidModel::Units::mm_t_s, {});
    expect_same(small, mesh, 1e-6, name_of(shape));
    EXPECT_NEAR(small.materials[0].E, 70e9, 1.0);
    EXPECT_NEAR(small.materials[0].rho, 2700.0, 1e-9);
    std::vector<int> base;
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
      if (i % 3 == 0) base.push_back(static_cast<int>(i));
    for (const bool modern : {false, true}) {
      const SolidMesh got = read_gmsh(write("a.msh", gmsh_of(mesh, modern, base)), SolidModel::Units::si, {});
      expect_same(got, mesh, 0.0, name_of(shape));
      EXPECT_EQ(got.groups.at("base"), base);
      EXPECT_EQ(got.groups.at("body").size(), mesh.nodes.size());
    }
    SolidMesh with_material = read_gmsh(write("a.msh", gmsh_of(mesh, true, base)), SolidModel::Units::si, {});
    with_material.materials = mesh.materials;
    EXPECT_NO_THROW(solid_mesh(with_material, {}, {}));
  }
}

TEST_F(SolidFiles, HaveNumbersInAllWaysOfTheirFormat) {
  const SolidMesh mesh = test::block(SolidShape::hexa8, {1, 1, 1}, [](const Vector3d& s) { return s; }, {});
  for (const std::string seven :
       {"7.0+10", "7.+10", "7.0E10", "7.E+10", "7.D+10", "7.d10", "70000000000.", "+7.0E+10", "0.7E+11", ".7+11"}) {
    const SolidMesh got = read_bulk_data(write("a.bdf", bulk_of(mesh, Fields::large, seven, "270000.-2")), SolidModel::Units::si, {});
    EXPECT_EQ(got.materials[0].E, 70e9) << seven;
    EXPECT_EQ(got.materials[0].rho, 2700.0);
  }
  for (const std::string bad : {"seven", "7.0.1", "7E", "nan", "inf", "0x7", "7.0+10x"})
    EXPECT_EQ(refused("a.bdf", bulk_of(mesh, Fields::large, bad)).at.mark.line, 3) << bad;
  // E out of G and nu, and case control above the bulk data.
  std::string text = bulk_of(mesh, Fields::free);
  text = "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\n" + text.replace(text.find("7.0+10,,"), 8, ",2.6+10,");
  EXPECT_NEAR(read_bulk_data(write("a.bdf", text), SolidModel::Units::si, {}).materials[0].E, 2 * 1.3 * 2.6e10, 1.0);
}

TEST_F(SolidFiles, OfBulkDataAreRefusedWithTheirLine) {
  const SolidMesh mesh = test::block(SolidShape::hexa8, {1, 1, 1}, [](const Vector3d& s) { return s; }, {});
  const std::string good = bulk_of(mesh, Fields::free);  // line 1 a remark, 2 PSOLID, 3 MAT1, 4 to 11 GRID, 12 and 13 CHEXA
  const auto expect = [&](const std::string& line, const std::string& got, int at = 14) {
    std::string text = good;
    text.insert(text.find("ENDDATA"), line + "\n");
    const Diagnostic d = refused("a.bdf", text);
    EXPECT_EQ(d.at.mark.line, at) << line << render(d);
    EXPECT_NE(d.got.find(got), std::string::npos) << line << render(d);
    EXPECT_EQ(d.at.key_path, "modal.solid.mesh");
  };
  EXPECT_EQ(refused("a.bdf", good).got, "");
  expect("CQUAD4,9,1,10,20,30,40", "CQUAD4");
  expect("CONM2,9,10,0,3.5", "CONM2");
  expect("RBE2,9,10,123,20,30", "RBE2");
  expect("MPC,9,10,1,1.,20,1,-1.", "MPC");
  expect("PARAM,WTMASS,.00259", "WTMASS");
  // A file without the line that parts case control from bulk data begins with it; parameters may stand above it.
  for (const char* more : {"BEGIN BULK", "BEGIN SUPER=1", "BEGIN BULK SUPER=1"}) {
    std::string text = "BEGIN BULK\n" + good;
    text.insert(text.find("ENDDATA"), more + std::string("\n"));
    EXPECT_EQ(refused("a.bdf", text).at.mark.line, 15) << more;
  }
  EXPECT_EQ(refused("a.bdf", "SOL 103\nCEND\nPARAM,WTMASS,.00259\nBEGIN BULK\n" + good).at.mark.line, 3);
  EXPECT_EQ(refused("a.bdf", "SOL 103\nCEND\n" + good).hint, "what stands before the bulk data ends with a line BEGIN BULK");
  expect("INCLUDE 'other.bdf'", "INCLUDE");
  expect("GRID,200,7,1.,2.,3.", "system 7");
  // Numbers of 17 characters in fields of 16: what is left of -5.0E-02 is -5.0E-0.
  expect("GRID*                200                0.0000000000E+00-5.0000000000E-02*\n*       0.0000000000E+00", "*", 15);
  expect("GRID*                200                0.0000000000E+00-5.0000000000E-02\n*       0.0000000000E+00", "*", 15);
  expect("GRID*                200                0.000000000E+00 0.0000000000E+00*\n*       -5.0000000000E-02", "system 2");
  expect("GRID,200,,1.,2.,3.,,13", "with 13");
  expect("GRID,10,,1.,2.,3.", "node 10 twice");
  expect("GRID,200,,1.,2.,x", "X");
  expect("GRDSET,,,,,,,456", "GRDSET");
  expect("CTETRA,9,4,10,20,30,50", "element 9 with 4");
  expect("CPENTA,9,4,10,20,30,50,60,70", "element 9 with 6");
  expect("CTETRA,9,4,10,20,30,50,,70\n,80,40,60,10", "without its node 5");
  expect("CHEXA,1,4,10,20,30,40,50,60\n,70,80", "element 1 twice");
  expect("CHEXA,9,4,10,20,30,40,50,60\n,70,990", "node 990");
  expect("CHEXA,9,5,10,20,30,40,50,60\n,70,80", "5 of element 9");
  expect("CHEXA,9,4,10,20,30,40,50,60\n,70", "element 9 with 7");
  expect("PSOLID,5,77\nCHEXA,9,5,10,20,30,40,50,60\n,70,80", "material 77");
  expect("PSOLID,5,9,,,,,PFLUID", "PFLUID");
  expect("MAT1,5,7.+10,9.+9,.3,2700.", "G = 9e+09");
  expect("MAT1,5,7.+10,,,2700.", "fewer");
  expect("MAT1,5,7.+10,,.5,2700.", "nu = 0.5");
  expect("MAT1,5,-7.+10,,.3,2700.", "E = -7e+10");
  expect("MAT1,5,7.+10,,.3,-1.", "rho = -1");
  expect("GRID,200,,1.,2.,3.,0,456,0,+A,5", "10");
  EXPECT_EQ(refused("b.bdf", "").got, "") << "no element: told by what makes a body of it";
  EXPECT_EQ(number_of(refused("c.bdf", "+,1,2\n").code), "C0321");
  // A mark of any name, a blank one, and displacements in a system that is there.
  for (const char* more : {"GRID*                200                0.0000000000E+00 0.000000000E+00ABC\n*BC      0.000000000E+00\n",
                           "GRID*                200                0.0000000000E+00 0.000000000E+00\n*        0.000000000E+00\n",
                           "GRID,200,,1.,2.,3.,8\nCORD2R,8,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n", "GRID,200,,1.,2.,3.,-1\n",
                           "GRID,200,,1.,2.,3.,8\nCORD1R,7,10,20,30,8,10,20,40\n"}) {
    std::string text = good;
    text.insert(text.find("ENDDATA"), more);
    EXPECT_EQ(refused("a.bdf", text).got, "") << more;
  }
  // Passed over, and told.
  std::string text = good;
  text.insert(
      text.find("ENDDATA"),
      "SPC1,1,123,10\nSPC1,1,123,20\nFORCE,1,10,0,1.,1.,0.,0.\nPARAM,POST,-1\nPARAM,WTMASS,1.0\nCORD2R,7,0,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n");
  const SolidMesh got = read_bulk_data(write("a.bdf", text), SolidModel::Units::si, {});
  EXPECT_EQ(got.passed_over, (std::vector<std::string>{"CORD2R", "FORCE", "PARAM POST", "PARAM WTMASS", "SPC1 (2)"}));
}

TEST_F(SolidFiles, OfGmshAreRefusedWithTheirLine) {
  const SolidMesh mesh = test::block(SolidShape::tetra10, {1, 1, 1}, [](const Vector3d& s) { return s; }, {});
  for (const bool modern : {false, true}) {
    const std::string good = gmsh_of(mesh, modern, {0});
    EXPECT_EQ(refused("a.msh", good).got, "");
    const auto expect = [&](const std::string& from, const std::string& to, const std::string& got) {
      std::string text = good;
      ASSERT_NE(text.find(from), std::string::npos) << from;
      const Diagnostic d = refused("a.msh", text.replace(text.find(from), from.size(), to));
      EXPECT_NE(d.got.find(got), std::string::npos) << to << render(d);
      EXPECT_GT(d.at.mark.line, 0) << render(d);
    };
    expect("0 8\n", "1 8\n", "binary");
    expect(modern ? "4.1 0" : "2.2 0", "4 0 ", "4");
    expect("$EndElements", "$EndElement", "$EndElement");
    expect("$Nodes", "$Nods", "the end of the file");
    expect("$EndElements\n", "", "the end of the file");
    expect(modern ? "0 1 15 1" : "1000 15 2 7 1", modern ? "0 1 99 1" : "1000 99 2 7 1", "type 99");
    expect(modern ? "3 1 11" : "1 11 2 8 1", modern ? "3 1 4" : "1 4 2 8 1", "10 of element 1");
    expect(modern ? "\n2\n3\n" : "\n2 1", modern ? "\n1\n3\n" : "\n1 1", "node 1 twice");
  }
}

TEST_F(SolidFiles, AreTakenByTheModesOfABodyAndItsCache) {
  const SolidMesh mesh =
      test::block(SolidShape::penta15, {3, 1, 1}, [](const Vector3d& s) { return Vector3d(s.x(), 0.2 * s.y(), 0.1 * s.z()); }, {});
  std::vector<int> base;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if (mesh.nodes[i].x() < 1e-9) base.push_back(static_cast<int>(i));
  ModalSource by_bulk, by_gmsh;
  SolidModel solid{write("a.bdf", bulk_of(mesh, Fields::large)), SolidModel::Units::si, {}, {}, Vector3d::Zero()};
  solid.root.normal = Vector3d::UnitX();
  by_bulk.model = solid;
  solid = {write("a.msh", gmsh_of(mesh, true, base)), SolidModel::Units::si, {{70e9, 0.3, 2700.0}}, {}, Vector3d::Zero()};
  solid.root.group = "base";
  by_gmsh.model = solid;
  for (ModalSource* source : {&by_bulk, &by_gmsh}) {
    source->modes.count = 4;
    source->points = {{.name = "tip", .position = {1, 0, 0}}};
    source->points[0].nodes.within = 0.3;
  }
  const ModalData a = make_modal_data(by_bulk), b = make_modal_data(by_gmsh);
  EXPECT_LE((a.K - b.K).norm(), 1e-5 * b.K.norm()) << "six digits of the coordinates";
  EXPECT_LE((a.nodes[1].Psi.cwiseAbs() - b.nodes[1].Psi.cwiseAbs()).norm(), 1e-4 * b.nodes[1].Psi.norm());
  const std::string name = ModeCache::name_of(by_bulk);
  EXPECT_FALSE(name.empty());
  ModalSource other = by_bulk;
  other.points[0].nodes.within = 0.2;
  EXPECT_NE(ModeCache::name_of(other), name);
  other = by_bulk;
  std::get<SolidModel>(other.model).root.normal = Vector3d::UnitY();
  EXPECT_NE(ModeCache::name_of(other), name);
  write("a.bdf", bulk_of(mesh, Fields::large, "7.1+10"));
  EXPECT_NE(ModeCache::name_of(by_bulk), name) << "the content of the mesh";
  std::get<SolidModel>(by_gmsh.model).material.clear();
  EXPECT_THROW(make_modal_data(by_gmsh), InputError);
}

/// A free body: mean axes, the frequencies of its matrices, and a root that moves with its set as one rigid frame.
TEST_F(SolidFiles, OfAFreeBodyMoveAboutMeanAxes) {
  const SolidMesh mesh =
      test::block(SolidShape::hexa20, {6, 1, 1}, [](const Vector3d& s) { return Vector3d(1.2 * s.x(), 0.2 * s.y(), 0.125 * s.z()); },
                  {70e9, 0.3, 2700.0});
  ModalSource source;
  SolidModel solid{write("a.bdf", bulk_of(mesh, Fields::large)), SolidModel::Units::si, {}, {}, Vector3d::Zero()};
  source.model = solid;
  source.boundary = Boundary::free;
  source.modes.count = 5;
  source.points = {{.name = "tip", .position = {1.2, 0, 0}}};
  source.points[0].nodes.normal = Vector3d::UnitX();
  Warnings warnings;
  const ModalData nearest = make_modal_data(source, &warnings);
  EXPECT_TRUE(warnings.all().empty());
  const FeModel model = solid_mesh(read_bulk_data(solid.mesh, solid.units, {}), {}, {});
  const FeModes modes = normal_modes(model, {}, 5, RigidModes::remove, {});
  EXPECT_LE((nearest.K.diagonal() - modes.omega2).norm(), 1e-12 * modes.omega2.norm());
  const Eigen::MatrixXd momenta = model.rigid_shapes().transpose() * (model.M * modes.shapes);
  EXPECT_LE(momenta.norm(), 1e-10);
  EXPECT_TRUE(nearest.integrals.I3.isZero(0.0));
  // Free and free: the first bending mode of a beam 1.2 x 0.125 m, (4.730 / L)^2 sqrt(EI / rho A), less what shear and rotary inertia take.
  const double thin = std::pow(4.730041 / 1.2, 2) * std::sqrt(70e9 * 0.125 * 0.125 / 12 / 2700);
  EXPECT_NEAR(std::sqrt(modes.omega2(0)) / thin, 1.0 - 0.03, 0.02);

  solid.root.normal = Vector3d::UnitX();
  source.model = solid;
  const ModalData by_face = make_modal_data(source);
  EXPECT_EQ(by_face.nodes[0].position, Vector3d::Zero());
  NodeSet face;
  face.normal = Vector3d::UnitX();
  const Eigen::MatrixXd want = grip_of(model, face, Vector3d::Zero(), "root", {}).of(modes.shapes, 3);
  EXPECT_LE((by_face.nodes[0].Phi - want.topRows(3)).norm(), 1e-9 * want.norm());
  EXPECT_LE((by_face.nodes[0].Psi - want.bottomRows(3)).norm(), 1e-9 * want.norm());
  EXPECT_GT(want.bottomRows(3).norm(), 0.1);

  SolidMesh far = mesh;  // no node near the origin, and no root
  for (Vector3d& x : far.nodes) x.y() += 9.0;
  solid.root = {};
  write("a.bdf", bulk_of(far, Fields::large));
  source.model = solid;
  source.points.clear();
  try {
    make_modal_data(source);
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().at.key_path, "solid.root");
  }
}

/// Of all modes of a body the effective masses add up to its rigid mass, less what the held nodes carry themselves.
TEST_F(SolidFiles, HaveEffectiveMassesThatAddUp) {
  const SolidMesh mesh = test::block(SolidShape::penta15, {2, 1, 1},
                                     [](const Vector3d& s) { return Vector3d(s.x(), 0.5 * s.y(), 0.5 * s.z()); }, {70e9, 0.3, 2700.0});
  const FeModel model = solid_mesh(mesh, {}, {});
  std::vector<int> root;
  for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)
    if (model.nodes[static_cast<std::size_t>(i)].x() < 1e-9) root.push_back(i);
  const std::vector<int> held = dofs_of(root, 3);
  const FreePart free(model.n_dofs(), held);
  const int all = static_cast<int>(free.dofs.size());
  const FeModes modes = normal_modes(model, held, all, RigidModes::refuse, {});
  const auto records = audit_modes(model, modes, {});
  Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
  for (const ModeRecord& r : records) sum += r.effective_mass;
  // What moves without the held dofs: R* M R of the free ones with their coupling, M_fr M_ff^-1 M_fr.
  const Eigen::MatrixXd MR = model.M * model.rigid_shapes();
  Eigen::MatrixXd load(all, 6);
  for (int i = 0; i < all; ++i) load.row(i) = MR.row(free.dofs[static_cast<std::size_t>(i)]);
  const Eigen::MatrixXd moved = load.transpose() * SparseFactor(free.block(model.M)).solve(load);
  EXPECT_LE((sum - moved.diagonal()).norm(), 1e-9 * sum.norm());
}

/// As NASTRAN has it: a material that no element has needs no density, one that elements have and that has none weighs nothing, which is
/// told; a body with no mass at all is refused.
TEST_F(SolidFiles, MayHaveMaterialsWithoutDensity) {
  const SolidMesh mesh = test::block(SolidShape::hexa20, {4, 1, 1},
                                     [](const Vector3d& s) { return Vector3d(s.x(), 0.2 * s.y(), 0.1 * s.z()); }, {70e9, 0.3, 2700.0});
  const auto of = [&](const std::string& material, const std::string& property, Warnings& warnings) {
    std::string text = bulk_of(mesh, Fields::free);
    text.insert(text.find("MAT1"), "PSOLID,5,8\nMAT1,8,7.0+10,,.3" + material + "\n");
    text.replace(text.find("CHEXA,4,4"), 9, "CHEXA,4," + property);
    ModalSource source;
    SolidModel solid{write("a.bdf", text), SolidModel::Units::si, {}, {}, Vector3d::Zero()};
    solid.root.normal = Vector3d::UnitX();
    source.model = solid, source.modes.count = 3, source.at.key_path = "modal";
    return make_modal_data(source, &warnings);
  };
  Warnings unused, told, light;
  EXPECT_NEAR(of("", "4", unused).integrals.I1, 54.0, 1e-9);
  const ModalData none = of("", "5", told), little = of(",1.-6", "5", light);
  EXPECT_NEAR(none.integrals.I1, 0.75 * 54.0, 1e-9);
  EXPECT_LE((none.K - little.K).norm(), 1e-8 * little.K.norm()) << "a density of 1e-6 is 4e-10 of the others";
  const auto about = [](const Warnings& all) {
    std::string out;
    for (const Warning& w : all.all())
      if (w.what.about.find("MAT1") != std::string::npos) out += w.what.about;
    return out;
  };
  EXPECT_EQ(about(unused), "");
  EXPECT_EQ(about(told), "elements that weigh nothing, their material has no density: MAT1 8 (1)");

  std::string text = bulk_of(mesh, Fields::free, "7.0+10", "");
  const SolidMesh nothing = read_bulk_data(write("a.bdf", text), SolidModel::Units::si, {});
  try {
    solid_mesh(nothing, {}, {});
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().expected, "a body with mass: a material with a density, or `masses`");
  }
  PointMass tip{.mass = 2.0, .position = {1.0, 0.0, 0.0}, .inertia = Eigen::Matrix3d::Zero()};
  tip.nodes.normal = Vector3d::UnitX();
  EXPECT_NEAR(solid_mesh(nothing, {tip}, {}).point_mass.sum(), 2.0, 1e-15);
}

TEST_F(SolidFiles, InOtherUnitsThanSaidAreDoubted) {
  const SolidMesh mesh = test::block(SolidShape::hexa8, {2, 1, 1}, [](const Vector3d& s) { return s; }, {});
  ModalSource source;
  SolidModel solid{write("mm.bdf", bulk_of(mesh, Fields::large, "7.0+4", "2.7-9", 1e3)), SolidModel::Units::si, {}, {}, Vector3d::Zero()};
  solid.root.normal = Vector3d::UnitX();
  source.model = solid;
  source.modes.count = 1;
  source.at.key_path = "modal";
  Warnings warnings;
  make_modal_data(source, &warnings);
  std::vector<std::string> about;
  const auto of_material = [](const Warning& w) { return number_of(w.what.code) == std::string("W0302"); };  // not of one mode that is kept
  for (const Warning& w : warnings.all()) {
    if (!of_material(w)) continue;
    EXPECT_EQ(w.what.at.key_path.substr(0, 20), "modal.solid.material");
    about.push_back(w.what.hint);
  }
  EXPECT_EQ(about.size(), 2u);
  std::get<SolidModel>(source.model).units = SolidModel::Units::mm_t_s;
  Warnings none;
  make_modal_data(source, &none);
  EXPECT_TRUE(std::ranges::none_of(none.all(), of_material));
}

}  // namespace
}  // namespace cardan
