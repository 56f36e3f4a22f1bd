// Meshes: OBJ, OFF, STL, and the points drawn from them.
#include <gtest/gtest.h>

#include <cmath>

#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

Result<Geometry> obj(const std::string& content, const ReadOptions& options = {}) {
  return parse(content, CloudFormat::obj, options);
}
Result<Geometry> off(const std::string& content, const ReadOptions& options = {}) {
  return parse(content, CloudFormat::off, options);
}
Result<Geometry> stl(const std::string& content) { return parse(content, CloudFormat::stl); }

const std::vector<Vec3d> square = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
const std::string square_v = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(Obj, ReadsFacesOfEverySpelling) {
  for (const char* faces :
       {"f 1 2 3 4\n", "f 1/1 2/2/2 3//3 4\n", "f -4 -3 -2 -1\n", "f 1 2 3 \\\n 4 # a quad\r\n",
        "vt 0 0\nvn 0 0 1\ng side\nusemtl grey\ns 1\nf 1/1/1 -3/-1 3 -1//-1"}) {
    const auto read = obj("# square\nmtllib a.mtl\no square\n" + square_v + faces);
    ASSERT_TRUE(read) << faces << message(read);
    EXPECT_EQ(read->mesh.vertices, square);
    EXPECT_EQ(read->mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}})) << faces;
  }
}

TEST(Obj, WithoutFacesIsACloud) {
  const auto read = obj("vn 0 0 2\nv 1 2 3 1 0 .5\nvn 0 1 0\nv -4.5 .25 1e3 0 0 0\n");
  ASSERT_TRUE(read) << message(read);
  EXPECT_FALSE(read->is_mesh());
  EXPECT_EQ(read->cloud.normals, (std::vector<Vec3f>{{0, 0, 1}, {0, 1, 0}}));
  EXPECT_EQ(read->cloud.colors, (std::vector<Vec3f>{{1, 0, 0.5f}, {0, 0, 0}}));
}

TEST(Obj, NamesABadFace) {
  EXPECT_EQ(message(obj(square_v + "f 1 2 5\n")), "scan.dat: line 5: a face uses vertex 5; there are 4");
  EXPECT_EQ(message(obj(square_v + "f 1 2 -5\n")),
            "scan.dat: line 5: a face uses vertex -5; there are 4 so far");
  EXPECT_EQ(message(obj(square_v + "f 0 1 2\n")),
            "scan.dat: line 5: a face uses vertex 0; there are 4 so far");
  EXPECT_EQ(message(obj(square_v + "f 1 2 x/3\n")), "scan.dat: line 5: \"x/3\" is not a face vertex");
  EXPECT_EQ(message(obj("v 0 0\n")), "scan.dat: line 1: a vertex of 2 values; x, y and z need 3");
  EXPECT_EQ(message(obj("v 0 0 1\nv 0 nan 0\n", strict)),
            "scan.dat: line 2: point 1: y is nan; coordinates must be finite");
}

TEST(Off, ReadsItsVariants) {
  for (const char* content :
       {"OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n",
        "OFF4 1 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n",
        "OFF # square\n# a comment\n\n4 1\n0 0 0\n1 0 0 # second\n1 1 0\n0 1 0\n4 0 1 2 3",
        "COFF\n4 1 0\n0 0 0 255 0 0 255\n1 0 0 0 0 0 255\n1 1 0 0 0 0 255\n0 1 0 0 0 0 255\n4 0 1 2 3\n",
        "NOFF\n4 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n4 0 1 2 3\n"}) {
    const auto read = off(content);
    ASSERT_TRUE(read) << content << message(read);
    EXPECT_EQ(read->mesh.vertices, square);
    EXPECT_EQ(read->mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
  }
  const auto both = off("CNOFF\n1 0 0\n1 2 3 0 0 1 0.5 0 1 1\n");
  ASSERT_TRUE(both) << message(both);
  EXPECT_EQ(both->cloud.normals.at(0), (Vec3f{0, 0, 1}));
  EXPECT_EQ(both->cloud.colors.at(0), (Vec3f{0.5f, 0, 1}));
}

TEST(Off, NamesWhatIsWrong) {
  EXPECT_EQ(message(off("OFF\n400 1 0\n0 0 0\n")),
            "scan.dat: line 2: 400 vertices need at least 2400 bytes, 6 remain");
  EXPECT_EQ(message(off("OFF\n1 1 0\n0 0 0\n3 0 0 1\n")),
            "scan.dat: line 4: a face uses vertex \"1\"; there are 1");
  EXPECT_EQ(message(off("OFF\n1 1 0\n0 0 0\n3 0 0\n")),
            "scan.dat: line 4: a face announces 3 corners and has 2");
  EXPECT_EQ(message(off("4OFF\n1 0 0\n0 0 0 0\n")), "scan.dat: \"4OFF\": only three-dimensional OFF is read");
  EXPECT_EQ(message(off("PLY\n")), "scan.dat: line 1: not an OFF file: \"PLY\"");
}

std::string facet(std::array<float, 9> c) {
  return little(0.f, 0.f, 0.f, c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], std::uint16_t{0});
}

TEST(Stl, WeldsEqualCorners) {
  const std::string binary = "solid not text" + std::string(66, '\0') + little(2u) +
                             facet({0, 0, 0, 1, 0, 0, 1, 1, 0}) + facet({-0.f, 0, 0, 1, 1, 0, 0, 1, 0});
  const std::string text =
      "solid square\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 1 1 0\n "
      "endloop\n"
      "endfacet\nfacet normal 0 0 1\n outer loop\n  vertex -0 0 0\n  vertex 1 1 0\n  vertex 0 1e0 0\n "
      "endloop\nendfacet\nendsolid square\n";
  for (const std::string& content : {binary, text}) {
    const auto read = stl(content);
    ASSERT_TRUE(read) << message(read);
    EXPECT_EQ(read->mesh.vertices, square);
    EXPECT_EQ(read->mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
  }
}

TEST(Stl, NamesWhatIsWrong) {
  const std::string header(80, 'h');
  EXPECT_EQ(message(stl(header + little(4000000000u) + facet({}))),
            "scan.dat: byte 80: 4000000000 triangles need 200000000000 bytes, 50 remain");
  EXPECT_EQ(message(stl(header + little(1u) + facet({0, 0, 0, 1, NAN, 0, 1, 1, 0}))),
            "scan.dat: byte 108: a corner has nan; coordinates must be finite");
  EXPECT_EQ(message(stl(header + little(0u))), "scan.dat: no triangles");
  EXPECT_EQ(message(stl("solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nendloop\n")),
            "scan.dat: line 6: a facet of 2 corners, not 3");
  EXPECT_EQ(message(stl("solid\nfacet\nouter loop\nvertex 0 0 0\n")),
            "scan.dat: line 4: the file ends within a facet");
}

// A unit square in z = 0 and, three times as large, one in the plane x = 5.
Mesh two_squares() {
  const double side = std::sqrt(3.0);
  Mesh mesh;
  mesh.vertices = square;
  mesh.vertices.insert(mesh.vertices.end(), {{5, 0, 0}, {5, side, 0}, {5, side, side}, {5, 0, side}});
  mesh.triangles = {{0, 1, 2}, {1, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  return mesh;
}

TEST(SampleMesh, IsUniformByAreaWithUnitFaceNormals) {
  const auto cloud = sample_mesh(two_squares(), 20000, 7);
  ASSERT_TRUE(cloud);
  ASSERT_EQ(cloud->normals.size(), 20000u);
  std::size_t small = 0, quarter = 0;
  for (std::size_t i = 0; i < cloud->size(); ++i) {
    const Vec3d& p = cloud->positions[i];
    const bool flat = p[0] < 4;
    EXPECT_EQ(cloud->normals[i], (flat ? Vec3f{0, 0, 1} : Vec3f{1, 0, 0}));
    small += flat;
    quarter += flat && p[0] < 0.5 && p[1] < 0.5;
  }
  EXPECT_NEAR(static_cast<double>(small), 5000, 4 * std::sqrt(20000 * 0.25 * 0.75));
  EXPECT_NEAR(static_cast<double>(quarter), 1250, 4 * std::sqrt(1250.0));
}

TEST(SampleMesh, RepeatsForASeedAndMovesWithTheMesh) {
  const Mesh mesh = two_squares();
  const auto a = sample_mesh(mesh, 500, 1), again = sample_mesh(mesh, 500, 1),
             other = sample_mesh(mesh, 500, 2);
  EXPECT_EQ(a->positions, again->positions);
  EXPECT_NE(a->positions, other->positions);
  Mesh moved = mesh;
  const double c = std::cos(0.7), s = std::sin(0.7);
  const auto move = [&](const Vec3d& p) {
    return Vec3d{c * p[0] - s * p[1] + 100, s * p[0] + c * p[1] - 7, p[2] + 3};
  };
  for (Vec3d& vertex : moved.vertices) vertex = move(vertex);
  const auto b = sample_mesh(moved, 500, 1);
  for (std::size_t i = 0; i < 500; ++i) {
    const Vec3d expected = move(a->positions[i]);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(b->positions[i][k], expected[k], 1e-12);
  }
}

TEST(SampleMesh, TakesMeshesOfAnySize) {
  for (const double scale : {1e-200, 1e200}) {
    Mesh mesh = two_squares();
    for (Vec3d& vertex : mesh.vertices) {
      for (double& c : vertex) c *= scale;
    }
    const auto cloud = sample_mesh(mesh, 10, 1);
    ASSERT_TRUE(cloud) << scale;
    EXPECT_NEAR(std::hypot(cloud->normals[0][0], cloud->normals[0][1], cloud->normals[0][2]), 1, 1e-6);
  }
}

TEST(SampleMesh, KeepsTheNormalsOfSliversUnit) {
  Mesh mesh;
  for (const double far : {1e161, 1e300}) {
    mesh.vertices = {{2, 0, -3}, {1, 0.5, -3}, {2, far, -3}};
    mesh.triangles = {{0, 1, 2}};
    const auto cloud = sample_mesh(mesh, 10, 1);
    ASSERT_TRUE(cloud) << far << message(cloud);
    for (const Vec3f& normal : cloud->normals) EXPECT_EQ(normal, (Vec3f{0, 0, -1}));
  }
}

TEST(SampleMesh, RefusesWhatHasNoArea) {
  Mesh mesh = two_squares();
  EXPECT_EQ(sample_mesh(mesh, 0, 1).error().code, ErrorCode::invalid_argument);
  mesh.triangles = {{0, 1, 1}};
  EXPECT_EQ(message(sample_mesh(mesh, 5, 1)), "the mesh's 1 triangles have no area that a double can hold");
  mesh.triangles = {};
  EXPECT_FALSE(sample_mesh(mesh, 5, 1));
  mesh.triangles = {{0, 1, 8}};
  EXPECT_EQ(message(sample_mesh(mesh, 5, 1)), "triangle 0 uses vertex 8; there are 8");
}

}  // namespace
}  // namespace bitr::io
