// Files on disk: reading by extension, writing all or nothing, drawing fewer points.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <numeric>

#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

namespace fs = std::filesystem;

class CloudFile : public testing::Test {
 protected:
  CloudFile() {
    std::string name = (fs::temp_directory_path() / "bitr-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~CloudFile() override {
    ::chmod(folder_.c_str(), 0700);
    fs::remove_all(folder_);
  }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  static std::string content(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  static std::span<const std::byte> bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

  fs::path folder_;
};

PointCloud numbered(std::size_t count) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    cloud.positions.push_back({static_cast<double>(i), 0, 0.5});
    cloud.normals.push_back({0, 0, i % 2 ? 1.f : -1.f});
  }
  return cloud;
}

TEST_F(CloudFile, ReadsBackWhatItWrote) {
  const PointCloud cloud = numbered(100);
  ASSERT_TRUE(write_ply(folder_ / "a.PLY", cloud));
  const auto read = read_cloud(folder_ / "a.PLY");
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->positions, cloud.positions);
  EXPECT_EQ(read->normals, cloud.normals);
  EXPECT_EQ(entries(), 1u);
}

TEST_F(CloudFile, SamplesAMesh) {
  std::ofstream(folder_ / "m.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  ReadOptions options;
  options.mesh_points = 64;
  const auto read = read_cloud(folder_ / "m.obj", options);
  ASSERT_TRUE(read) << message(read);
  EXPECT_EQ(read->size(), 64u);
  std::ofstream(folder_ / "flat.obj") << "v 0 0 0\nv 1 0 0\nf 1 2 2\n";
  EXPECT_EQ(message(read_cloud(folder_ / "flat.obj")),
            (folder_ / "flat.obj").string() + ": the mesh's 1 triangles have no area that a double can hold");
}

TEST_F(CloudFile, NamesTheFileThatCannotBeRead) {
  EXPECT_EQ(message(read_cloud(folder_ / "none.ply")),
            (folder_ / "none.ply").string() + ": cannot open: No such file or directory");
  EXPECT_EQ(read_cloud(folder_ / "none.ply").error().code, ErrorCode::io);
  EXPECT_EQ(read_cloud(folder_ / "a.docx").error().code, ErrorCode::unsupported);
  fs::create_directory(folder_ / "folder.ply");
  EXPECT_EQ(read_cloud(folder_ / "folder.ply").error().code, ErrorCode::io);
  std::ofstream(folder_ / "two\nlines.ply") << "";
  EXPECT_EQ(message(read_cloud(folder_ / "two\nlines.ply")),
            folder_.string() + "/two?lines.ply: the file is empty");
}

TEST_F(CloudFile, ReadsWhatHasNoSize) {
  const auto zero_length_in_stat = read_file("/proc/self/status");
  ASSERT_TRUE(zero_length_in_stat);
  EXPECT_GT(zero_length_in_stat->size(), 100u);
}

TEST_F(CloudFile, ReplacesAtomicallyAndKeepsModeAndLinks) {
  const fs::path file = folder_ / "out.bin", link = folder_ / "link.bin";
  ASSERT_TRUE(write_file(file, bytes("old")));
  ::chmod(file.c_str(), 0640);
  fs::create_symlink(file, link);
  ASSERT_TRUE(write_file(link, bytes("new")));
  EXPECT_EQ(content(file), "new");
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(fs::status(file).permissions(), fs::perms{0640});
  EXPECT_EQ(entries(), 2u);
}

TEST_F(CloudFile, TakesALongNameAndADevice) {
  EXPECT_TRUE(write_file(folder_ / std::string(250, 'n'), bytes("x")));
  EXPECT_TRUE(write_file("/dev/null", bytes("x")));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST_F(CloudFile, KeepsTheOldFileWhenTheDiskIsFull) {
  const fs::path file = folder_ / "out.bin";
  ASSERT_TRUE(write_file(file, bytes("old")));
  // A limit on file size stands in for a full disk: the write fails half-way, with its errno.
  rlimit before;
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{4096, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ::setrlimit(RLIMIT_FSIZE, &small);
  const auto written = write_file(file, std::vector<std::byte>(100000));
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::io);
  EXPECT_EQ(written.error().message, file.string() + ": cannot write: File too large");
  EXPECT_EQ(content(file), "old");
  EXPECT_EQ(entries(), 1u);
  if (fs::exists("/dev/full")) {
    EXPECT_EQ(message(write_file("/dev/full", bytes("x"))),
              "/dev/full: cannot write: No space left on device");
  }
}

TEST_F(CloudFile, NamesTheFolderThatCannotBeWritten) {
  const auto missing = write_file(folder_ / "no" / "such" / "out.bin", bytes("x"));
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::io);
  EXPECT_EQ(missing.error().message, (folder_ / "no/such/out.bin").string() +
                                         ": cannot create a file beside it: No such file or directory");
  EXPECT_EQ(message(write_file(folder_, bytes("x"))), folder_.string() + ": cannot write: Is a directory");
}

TEST_F(CloudFile, NamesTheFolderThatIsReadOnly) {
  if (::geteuid() == 0) GTEST_SKIP() << "every folder is writable for root";
  ::chmod(folder_.c_str(), 0500);
  const auto written = write_file(folder_ / "out.bin", bytes("x"));
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::io);
}

TEST(Subsample, DrawsDistinctPointsInOrder) {
  const PointCloud cloud = numbered(1000);
  const PointCloud some = subsample(cloud, 100, 3);
  ASSERT_EQ(some.size(), 100u);
  ASSERT_EQ(some.normals.size(), 100u);
  EXPECT_TRUE(some.colors.empty());
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_TRUE(i == 0 || some.positions[i - 1][0] < some.positions[i][0]);
    EXPECT_EQ(some.normals[i][2], static_cast<int>(some.positions[i][0]) % 2 ? 1.f : -1.f);
  }
  EXPECT_EQ(subsample(cloud, 100, 3).positions, some.positions);
  EXPECT_NE(subsample(cloud, 100, 4).positions, some.positions);
  EXPECT_EQ(subsample(cloud, 1000, 3).positions, cloud.positions);
  EXPECT_EQ(subsample(cloud, 5000, 3).positions, cloud.positions);
  EXPECT_EQ(subsample(cloud, 0, 3).size(), 0u);
}

TEST(Subsample, TakesEveryPointEquallyOften) {
  const PointCloud cloud = numbered(10);
  std::array<int, 10> taken{};
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    for (const Vec3d& point : subsample(cloud, 3, seed).positions)
      ++taken[static_cast<std::size_t>(point[0])];
  }
  for (const int count : taken) EXPECT_NEAR(count, 1200, 4 * std::sqrt(4000 * 0.3 * 0.7));
}

}  // namespace
}  // namespace bitr::io
