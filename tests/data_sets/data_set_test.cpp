#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <bitr/data.hpp>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <map>
#include <set>
#include <thread>

#include "folder.hpp"

namespace bitr {
namespace {

using test::ShapeFolder;
using testing::HasSubstr;

DataOptions small(std::vector<DataPart> parts) {
  DataOptions options;
  options.parts = std::move(parts);
  options.points_low = options.points_high = 64;
  return options;
}

bool same(const DataSample& a, const DataSample& b) {
  return a.source.positions == b.source.positions && a.reference.positions == b.reference.positions &&
         a.source.normals == b.source.normals && a.reference.normals == b.reference.normals &&
         a.T_reference_source.matrix() == b.T_reference_source.matrix() && a.shape == b.shape;
}

double farthest(const PointCloud& cloud, const Pose& T_cloud_object) {
  const Pose back = T_cloud_object.inverse();
  double reach = 0;
  for (const Vec3d& point : cloud.positions) {
    const Vec3d at = back.apply(point);
    reach = std::max(reach, std::hypot(at[0], at[1], at[2]));
  }
  return reach;
}

TEST(DataSet, SampleDependsOnItsPlaceAlone) {
  const ShapeFolder folder;
  for (int i = 0; i < 5; ++i) folder.write_box("box_" + std::to_string(i) + ".off", 5 + i);
  DataOptions options = small({{.kind = "aircraft", .shapes = 20},
                               {.kind = "vessels", .shapes = 20},
                               {.kind = "vessels", .shapes = 20, .protocol = Protocol::independent},
                               {.kind = "copy", .shapes = 3},
                               {.folder = folder.path(), .protocol = Protocol::complement}});
  options.noise = 0.01;
  options.points_low = 40;
  const DataSet data = DataSet::open(options).value(), again = DataSet::open(options).value();
  options.cache_bytes = 0;
  const DataSet forgetful = DataSet::open(options).value();
  EXPECT_EQ(data.fingerprint(), again.fingerprint());
  EXPECT_EQ(data.samples(), 68u);
  std::vector<DataSample> forwards;
  for (std::size_t i = 0; i < data.samples(); ++i) forwards.push_back(data.sample(1, i).value());
  for (std::size_t i = data.samples(); i-- > 0;) {
    EXPECT_TRUE(same(again.sample(1, i).value(), forwards[i])) << i;
    EXPECT_TRUE(same(forgetful.sample(1, i).value(), forwards[i])) << i;
    EXPECT_FALSE(same(data.sample(2, i).value(), forwards[i])) << i;
  }
  options.seed = 1;
  EXPECT_FALSE(same(DataSet::open(options).value().sample(1, 0).value(), forwards[0]));
}

TEST(DataSet, TruthJoinsTheClouds) {
  const DataSet data = DataSet::open(small({{.kind = "copy", .shapes = 4}})).value();
  const DataSample sample = data.sample(0, 0).value();
  ASSERT_EQ(sample.source.size(), 64u);
  for (std::size_t i = 0; i < 64; ++i) {
    const Vec3d at = sample.T_reference_source.apply(sample.source.positions[i]);
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(at[axis], sample.reference.positions[i][axis], 1e-12);
  }
  EXPECT_EQ(sample.overlap, 1);
}

TEST(DataSet, PoolIsDrawnOnceAndSamplesTakeSomeOfIt) {
  const auto in_object = [](const DataSample& sample) {
    std::set<std::array<long, 3>> places;  // to 1e-5
    const Pose back = sample.T_source_object.inverse();
    for (const Vec3d& point : sample.source.positions) {
      const Vec3d at = back.apply(point);
      places.insert({std::lround(at[0] * 1e5), std::lround(at[1] * 1e5), std::lround(at[2] * 1e5)});
    }
    return places;
  };
  for (const char* kind : {"aircraft", "vessels"}) {
    SCOPED_TRACE(kind);
    DataOptions options = small({{.kind = kind, .shapes = 1, .pool = 100, .breaks = 2, .share_high = 1}});
    options.parts[0].share_low = 1;
    const DataSet data = DataSet::open(options).value();
    const bool broken = options.parts[0].kind == "vessels";
    std::map<std::uint64_t, std::set<std::array<long, 3>>> drawn;  // by version
    for (std::uint64_t epoch = 0; epoch < 30; ++epoch) {
      const DataSample sample = data.sample(epoch, 0).value();
      EXPECT_EQ(sample.source.size(), 64u);
      EXPECT_EQ(sample.source.normals.size(), 64u);
      EXPECT_EQ(in_object(sample).size(), 64u);
      drawn[broken ? epoch % 2 : 0].merge(in_object(sample));
    }
    EXPECT_EQ(drawn.size(), broken ? 2u : 1u);
    for (const auto& [version, places] : drawn) {
      EXPECT_GT(places.size(), 95u);
      EXPECT_LE(places.size(), 110u);  // a place may round either way
    }
    options.parts[0].pool = 10;
    EXPECT_THAT(DataSet::open(options).error().message, HasSubstr("pool is 10, neither 0 nor in 64"));
  }
}

TEST(DataSet, ShapesWhosePoolsDoNotFitAreDrawnAnew) {
  constexpr std::size_t pool_bytes = 48 * 100;
  DataOptions options = small({{.kind = "vessels", .shapes = 5, .pool = 100, .breaks = 2},
                               {.kind = "copy", .shapes = 3, .weight = 0.5},
                               {.kind = "aircraft", .shapes = 5, .pool = 100}});
  const auto open = [&](std::size_t bytes) {
    options.cache_bytes = bytes;
    return DataSet::open(options).value();
  };
  const DataSet all = open(15 * pool_bytes), more = open(16 * pool_bytes), some = open(8 * pool_bytes),
                again = open(8 * pool_bytes), none = open(0);
  EXPECT_EQ(all.fingerprint(), more.fingerprint());
  EXPECT_EQ(some.fingerprint(), again.fingerprint());
  EXPECT_NE(some.fingerprint(), all.fingerprint());
  EXPECT_NE(some.fingerprint(), none.fingerprint());
  for (DataPart& part : options.parts) part.pool = 0;
  const DataSet without = open(1 << 20);
  std::size_t anew = 0, pooled = 0, differ = 0;
  for (std::uint64_t epoch = 0; epoch < 10; ++epoch)
    for (std::size_t i = 0; i < all.samples(); ++i) {
      const DataSample full = all.sample(epoch, i).value(), half = some.sample(epoch, i).value();
      EXPECT_TRUE(same(more.sample(epoch, i).value(), full));
      EXPECT_TRUE(same(again.sample(epoch, i).value(), half));
      const DataSample fresh = without.sample(epoch, i).value();
      EXPECT_TRUE(same(none.sample(epoch, i).value(), fresh));
      if (fresh.shape.starts_with("solids")) continue;
      anew += same(half, fresh);
      pooled += same(half, full);
      differ += !same(full, fresh);
    }
  EXPECT_EQ(anew + pooled, differ);
  EXPECT_NEAR(static_cast<double>(pooled) / static_cast<double>(differ), 8.0 / 15, 0.15);
}

TEST(DataSet, EveryShapeIsUsedOnceBeforeAnyIsUsedAgain) {
  DataOptions options =
      small({{.kind = "vessels", .shapes = 10, .weight = 3}, {.kind = "aircraft", .shapes = 10}});
  options.points_low = options.points_high = 8;
  options.samples = 8;  // six vessels and two aircraft an epoch
  const DataSet data = DataSet::open(options).value();
  std::map<std::string, std::vector<std::string>> used;
  std::vector<std::size_t> aircraft_first;
  for (std::uint64_t epoch = 0; epoch < 10; ++epoch)
    for (std::size_t i = 0; i < 8; ++i) {
      const std::string shape = data.sample(epoch, i).value().shape;
      used[shape.substr(0, shape.find('/'))].push_back(shape);
    }
  EXPECT_EQ(used["vessels"].size(), 60u);
  EXPECT_EQ(used["aircraft"].size(), 20u);
  for (auto& [kind, shapes] : used) {
    std::map<std::string, int> times;
    for (const std::string& shape : shapes) ++times[shape];
    EXPECT_EQ(times.size(), 10u);
    for (const auto& [shape, count] : times) EXPECT_EQ(count, static_cast<int>(shapes.size()) / 10) << shape;
  }
}

TEST(DataSet, SplitsShareNoShapeAndHaveTheirShares) {
  const ShapeFolder folder;
  for (int i = 0; i < 60; ++i)
    folder.write_box(std::to_string(i % 3) + "/box_" + std::to_string(i) + ".off", 5 + i);
  std::map<Split, std::set<std::string>> names;
  std::size_t total = 0;
  for (const Split split : {Split::train, Split::validation, Split::test}) {
    // The same shapes in two parts, cropped in two ways, once as fragments and once as copies.
    DataOptions options = small({{.kind = "fragments", .shapes = 300},
                                 {.kind = "copy", .shapes = 300},
                                 {.folder = folder.path()},
                                 {.folder = folder.path(), .protocol = Protocol::complement}});
    options.points_low = options.points_high = 40;
    options.split = split;
    options.validation_share = options.test_share = 0.2;
    const DataSet data = DataSet::open(options).value();
    total += data.shapes();
    // Every part gives as many samples an epoch, so that the larger ones need two to come round.
    for (std::uint64_t epoch = 0; epoch < 2; ++epoch)
      for (std::size_t i = 0; i < data.samples(); ++i)
        names[split].insert(data.sample(epoch, i).value().shape);
    // Every shape is in two parts.
    EXPECT_EQ(2 * names[split].size(), data.shapes());
  }
  EXPECT_EQ(total, 720u);
  std::set<std::string> all;
  for (const auto& [split, shapes] : names) all.insert(shapes.begin(), shapes.end());
  EXPECT_EQ(all.size(), 360u);
  EXPECT_NEAR(static_cast<double>(names[Split::test].size()), 72, 30);
  EXPECT_NEAR(static_cast<double>(names[Split::validation].size()), 72, 30);
}

TEST(DataSet, SplitOfAFileForgetsItsExtensionAndItsFolder) {
  std::map<Split, std::set<std::string>> names;
  for (const char* extension : {".off", ".OFF"}) {
    const ShapeFolder folder;
    for (int i = 0; i < 30; ++i) folder.write_box("deep/box_" + std::to_string(i) + extension, 3);
    for (const Split split : {Split::train, Split::validation, Split::test}) {
      DataOptions options = small({{.folder = folder.path()}});
      options.split = split;
      options.validation_share = options.test_share = 0.3;
      const DataSet data = DataSet::open(options).value();
      std::set<std::string> found;
      for (std::size_t i = 0; i < data.samples(); ++i) {
        const std::string shape = data.sample(0, i).value().shape;
        found.insert(shape.substr(0, shape.find('.')));
      }
      if (names[split].empty()) names[split] = found;
      EXPECT_EQ(found, names[split]);
    }
  }
}

TEST(DataSet, FilesAreCentredAndScaled) {
  const ShapeFolder folder;
  folder.write_box("box.off", 30);
  DataOptions options = small({{.folder = folder.path(), .share_low = 1, .share_high = 1}});
  options.points_low = options.points_high = 4000;
  const DataSet data = DataSet::open(options).value();
  const DataSample sample = data.sample(0, 0).value();
  EXPECT_EQ(sample.shape, "box.off");
  EXPECT_EQ(sample.source.size(), 4000u);
  EXPECT_EQ(sample.source.normals.size(), 4000u);
  const double reach = farthest(sample.source, sample.T_source_object);
  EXPECT_LE(reach, 0.5 + 1e-12);
  EXPECT_GT(reach, 0.48);
  // By its own name, too.
  options.parts[0].folder /= "box.off";
  EXPECT_TRUE(same(DataSet::open(options).value().sample(0, 0).value(), sample));
  // Two samples of the surface: no point is in both.
  EXPECT_NE(sample.T_reference_source.apply(sample.source.positions[0]), sample.reference.positions[0]);
}

TEST(DataSet, TwoSamplesOfACloudHaveNoPointInCommonIfThereAreEnough) {
  const ShapeFolder folder;
  folder.write_cloud("cloud.ply", 128, true);
  for (const bool same_points : {false, true}) {
    DataOptions options = small({{.folder = folder.path(), .share_low = 1, .share_high = 1}});
    options.same_points = same_points;
    const DataSample sample = DataSet::open(options).value().sample(0, 0).value();
    std::size_t common = 0;
    for (const Vec3d& point : sample.source.positions) {
      const Vec3d moved = sample.T_reference_source.apply(point);
      for (const Vec3d& other : sample.reference.positions)
        common += std::hypot(moved[0] - other[0], moved[1] - other[1], moved[2] - other[2]) < 1e-9;
    }
    EXPECT_EQ(common, same_points ? 64u : 0u);
  }
}

TEST(DataSet, BadFilesAreSkippedAndCountedWithTheirReasons) {
  const ShapeFolder folder;
  folder.write_box("good.off", 5);
  folder.write_cloud("also/good.ply", 200, true);
  folder.write_cloud("few.ply", 20, true);
  folder.write_cloud("bare.ply", 200, false);
  folder.write("broken.ply", "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\n");
  folder.write("flat.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n");
  folder.write("notes.md", "not a shape");
  DataOptions options = small({{.folder = folder.path()}});
  const DataSet data = DataSet::open(options).value();
  EXPECT_EQ(data.shapes(), 6u);
  EXPECT_TRUE(data.skipped().empty());
  std::set<std::string> used;
  for (std::uint64_t epoch = 0; epoch < 3; ++epoch)
    for (std::size_t i = 0; i < data.samples(); ++i) used.insert(data.sample(epoch, i).value().shape);
  EXPECT_EQ(used, (std::set<std::string>{"also/good.ply", "good.off"}));
  const auto skipped = data.skipped();
  ASSERT_EQ(skipped.size(), 4u);
  EXPECT_EQ(skipped[0].shape, "bare.ply");
  EXPECT_EQ(skipped[0].reason, "has no normals");
  EXPECT_EQ(skipped[1].shape, "broken.ply");
  EXPECT_THAT(skipped[1].reason, HasSubstr("broken.ply: "));
  EXPECT_EQ(skipped[2].reason, "has 20 points; 64 are asked for");
  EXPECT_THAT(skipped[3].reason, HasSubstr("no area"));

  options.normals = false;
  const DataSet bare = DataSet::open(options).value();
  used.clear();
  for (std::size_t i = 0; i < 30; ++i) {
    const DataSample sample = bare.sample(i, i % bare.samples()).value();
    used.insert(sample.shape);
    EXPECT_TRUE(sample.source.normals.empty());
  }
  EXPECT_TRUE(used.contains("bare.ply"));
}

TEST(DataSet, SaysSoWhenNothingCanBeUsed) {
  const ShapeFolder folder;
  folder.write("broken.ply", "ply\n");
  const DataSet data = DataSet::open(small({{.folder = folder.path()}})).value();
  const auto sample = data.sample(0, 0);
  ASSERT_FALSE(sample.has_value());
  EXPECT_EQ(sample.error().code, ErrorCode::bad_file);
  EXPECT_THAT(sample.error().message, HasSubstr("100 shapes in a row"));
  EXPECT_EQ(data.skipped().size(), 1u);
}

TEST(DataSet, LargeMeshesAreKeptAsPoints) {
  const ShapeFolder folder;
  // A bumpy sheet of 2·110² triangles.
  std::string obj;
  constexpr int side = 110;
  for (int i = 0; i <= side; ++i)
    for (int j = 0; j <= side; ++j)
      obj += "v " + std::to_string(i) + " " + std::to_string(j) + " " + std::to_string((i * j) % 7) + "\n";
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      const int a = i * (side + 1) + j + 1, b = a + side + 1;
      obj += "f " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(b + 1) + " " +
             std::to_string(a + 1) + "\n";
    }
  folder.write("sheet.obj", obj);
  const DataSet data = DataSet::open(small({{.folder = folder.path()}})).value();
  const DataSample a = data.sample(0, 0).value(), b = data.sample(1, 0).value();
  EXPECT_EQ(a.source.size(), 44u);
  EXPECT_EQ(a.source.normals.size(), 44u);
  EXPECT_FALSE(same(a, b));
}

TEST(DataSet, DrawsPointsAndSharesFromTheirRanges) {
  DataOptions options = small({{.kind = "aircraft", .shapes = 50, .share_low = 0.6, .share_high = 0.9}});
  options.points_low = 100;
  options.points_high = 200;
  const DataSet data = DataSet::open(options).value();
  std::size_t least = 1000, most = 0;
  double low = 1, high = 0;
  for (std::size_t i = 0; i < 50; ++i) {
    const DataSample sample = data.sample(0, i).value();
    least = std::min(least, sample.source.size());
    most = std::max(most, sample.source.size());
    low = std::min(low, sample.overlap);
    high = std::max(high, sample.overlap);
  }
  EXPECT_GE(least, 60u);
  EXPECT_LE(most, 180u);
  EXPECT_GT(most, least + 50);
  EXPECT_LT(low, 0.35);
  EXPECT_GT(high, 0.65);
}

TEST(DataSet, RefusesWhatIsOutOfRangeAndNamesThePart) {
  const auto message = [](const DataOptions& options) {
    const auto data = DataSet::open(options);
    EXPECT_FALSE(data.has_value());
    return data ? std::string() : data.error().message;
  };
  EXPECT_THAT(message({}), HasSubstr("at least one part"));
  EXPECT_THAT(message(small({{.kind = "vessels"}, {.kind = "tables"}})),
              HasSubstr("part 1 of the data: unknown kind"));
  EXPECT_THAT(message(small({DataPart{}})), HasSubstr("neither a kind nor a folder"));
  EXPECT_THAT(message(small({{.kind = "vessels", .folder = "/tmp"}})), HasSubstr("both"));
  EXPECT_THAT(message(small({{.kind = "vessels", .shapes = 0}})), HasSubstr("shapes is 0"));
  EXPECT_THAT(message(small({{.kind = "vessels", .weight = 0}})), HasSubstr("weight is 0"));
  EXPECT_THAT(message(small({{.kind = "vessels", .share_low = 0.8}})), HasSubstr("share is 0.8"));
  EXPECT_THAT(message(small({{.folder = "/nowhere/at/all"}})),
              HasSubstr("/nowhere/at/all: cannot be listed"));
  const ShapeFolder folder;
  EXPECT_THAT(message(small({{.folder = folder.path()}})), HasSubstr("no mesh or cloud"));
  folder.write_box("inner/box.off", 1);
  EXPECT_THAT(message(small({{.folder = folder.path()}, {.folder = folder.path() / "inner"}})),
              HasSubstr("lies in"));
  DataOptions options = small({{.kind = "vessels"}});
  options.points_low = 100;
  EXPECT_THAT(message(options), HasSubstr("points is 100 … 64"));
  options = small({{.folder = folder.path() / "inner/box.off"}});
  options.split = Split::validation;
  options.validation_share = 0;
  EXPECT_THAT(message(options), HasSubstr("none of its 1 shape falls"));
  folder.write("notes.md", "");
  EXPECT_THAT(message(small({{.folder = folder.path() / "notes.md"}})),
              HasSubstr("notes.md: cannot be listed"));
  options = small({{.kind = "vessels"}});
  options.noise = -1;
  EXPECT_THAT(message(options), HasSubstr("noise"));
  options = small({{.kind = "vessels"}});
  options.test_share = 0.95;
  EXPECT_THAT(message(options), HasSubstr("0.95"));
  options = small({{.kind = "vessels"}});
  EXPECT_THAT(DataSet::open(options).value().sample(0, 10'000).error().message, HasSubstr("sample 10000"));
}

TEST(DataSet, FingerprintChangesWithWhatTheSequenceDependsOn) {
  const ShapeFolder folder;
  folder.write_box("a.off", 1);
  std::set<std::uint64_t> prints;
  const auto add = [&](auto change) {
    DataOptions options = small({{.kind = "vessels", .shapes = 100}, {.folder = folder.path()}});
    change(options);
    prints.insert(DataSet::open(options).value().fingerprint());
  };
  add([](DataOptions&) {});
  add([](DataOptions& o) { o.seed = 1; });
  add([](DataOptions& o) { o.noise = 0.1; });
  add([](DataOptions& o) { o.points_high = 65; });
  add([](DataOptions& o) {
    o.split = Split::train;
    o.test_share = 0;
    o.validation_share = 0.001;
  });
  add([](DataOptions& o) { o.parts[0].first_seed = 1; });
  add([](DataOptions& o) { o.parts[0].protocol = Protocol::opposed; });
  folder.write_box("b.off", 1);
  add([](DataOptions&) {});
  EXPECT_GE(prints.size(), 7u);  // the split may happen to leave nothing out
}

TEST(DataSet, GivesHundredsOfSamplesASecond) {
  const ShapeFolder folder;
  for (int i = 0; i < 10; ++i) folder.write_box("box_" + std::to_string(i) + ".off", 5 + i);
  struct Case {
    const char* name;
    DataPart part;
    std::size_t points;
  };
  for (const Case& c : {Case{"aircraft", {.kind = "aircraft", .shapes = 300}, 1463},
                        {"vessels", {.kind = "vessels", .shapes = 300}, 1024},
                        {"pooled aircraft", {.kind = "aircraft", .shapes = 100, .pool = 4096}, 1463},
                        {"pooled vessels", {.kind = "vessels", .shapes = 100, .pool = 4096}, 1024},
                        {"fragments", {.kind = "fragments", .shapes = 60}, 1024},
                        {"meshes", {.folder = folder.path()}, 1463}}) {
    DataOptions options;
    options.parts = {c.part};
    options.points_low = options.points_high = c.points;
    options.noise = 0.01;
    const DataSet data = DataSet::open(options).value();
    for (const char* pass : {"new", "known"}) {  // shapes
      const std::size_t samples = std::min<std::size_t>(data.samples(), 100);
      const auto start = std::clock();
      for (std::size_t i = 0; i < samples; ++i) EXPECT_EQ(data.sample(0, i)->reference.size(), 1024u);
      const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      const double rate = static_cast<double>(samples) / seconds;
      RecordProperty(std::string(c.name) + "_" + pass + "_per_second", std::to_string(rate));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
      EXPECT_GT(rate, 20) << c.name;  // ten times less than on an idle core: tests share theirs
#endif
    }
  }
}

}  // namespace
}  // namespace bitr
