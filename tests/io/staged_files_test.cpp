// Files that appear together or not at all, whatever was there before.
#include "io/staged_files.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include <fstream>

#include "io/cloud_bytes.hpp"

namespace bitr::io {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class StagedFilesTest : public testing::Test {
 protected:
  StagedFilesTest() {
    std::string name = (fs::temp_directory_path() / "bitr-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~StagedFilesTest() override { fs::remove_all(folder_); }

  fs::path write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name) << content;
    return folder_ / name;
  }
  std::string content(const std::string& name) const {
    std::ifstream stream(folder_ / name);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }
  static std::span<const std::byte> bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

  using Names = std::vector<std::string>;
  fs::path folder_;
};

TEST_F(StagedFilesTest, AppearTogether) {
  write("a", "old a");
  StagedFiles files;
  ASSERT_TRUE(files.add(folder_ / "a", bytes("new a")));
  ASSERT_TRUE(files.add(folder_ / "b", bytes("new b")));
  EXPECT_EQ(content("a"), "old a");
  EXPECT_FALSE(fs::exists(folder_ / "b"));
  ASSERT_TRUE(files.commit());
  EXPECT_EQ(content("a"), "new a");
  EXPECT_EQ(content("b"), "new b");
  EXPECT_EQ(names(), (Names{"a", "b"}));
}

TEST_F(StagedFilesTest, AreDroppedUnlessCommitted) {
  write("a", "old a");
  {
    StagedFiles files;
    ASSERT_TRUE(files.add(folder_ / "a", bytes("new a")));
    ASSERT_TRUE(files.add(folder_ / "b", bytes("new b")));
    EXPECT_EQ(names().size(), 3u);
  }
  EXPECT_EQ(content("a"), "old a");
  EXPECT_EQ(names(), Names{"a"});
}

TEST_F(StagedFilesTest, ComeBackWhenOneCannotTakeItsPlace) {
  write("a", "old a");
  write("c", "old c");
  StagedFiles files;
  ASSERT_TRUE(files.add(folder_ / "a", bytes("new a")));
  ASSERT_TRUE(files.add(folder_ / "b", bytes("new b")));
  ASSERT_TRUE(files.add(folder_ / "c", bytes("new c")));
  // Somebody puts a folder where the last of them belongs.
  fs::remove(folder_ / "c");
  fs::create_directories(folder_ / "c" / "inside");
  const auto committed = files.commit();
  ASSERT_FALSE(committed);
  EXPECT_EQ(committed.error().code, ErrorCode::io);
  EXPECT_EQ(committed.error().message, (folder_ / "c").string() + ": cannot write: Is a directory");
  EXPECT_EQ(content("a"), "old a");
  EXPECT_EQ(names(), (Names{"a", "c"}));
}

TEST_F(StagedFilesTest, WaitForPipesAndDevices) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  write("a", "old a");
  StagedFiles files;
  ASSERT_TRUE(files.add(folder_ / "a", bytes("new a")));
  ASSERT_TRUE(files.add("/dev/full", bytes("x")));
  EXPECT_EQ(message(files.commit()), "/dev/full: cannot write: No space left on device");
  EXPECT_EQ(content("a"), "old a");
}

TEST_F(StagedFilesTest, LeadNowhereThroughALinkToNothing) {
  fs::create_symlink("b", folder_ / "link");
  StagedFiles files;
  EXPECT_EQ(message(files.add(folder_ / "link", bytes("x"))),
            (folder_ / "link").string() + ": cannot write: is a symbolic link to nothing");
  fs::create_symlink("loop", folder_ / "loop");
  EXPECT_THAT(message(files.add(folder_ / "loop", bytes("x"))), HasSubstr("loop: cannot write: "));
  ASSERT_TRUE(files.commit());
  EXPECT_EQ(names(), (Names{"link", "loop"}));
}

TEST_F(StagedFilesTest, AreNoMoreReadableThanWhatTheyReplace) {
  const fs::path secret = write("secret", "old");
  fs::permissions(secret, fs::perms{0600});
  StagedFiles files;
  ASSERT_TRUE(files.add(secret, bytes("new")));
  for (const auto& entry : fs::directory_iterator(folder_))
    EXPECT_EQ(entry.status().permissions(), fs::perms{0600}) << entry.path();
  ASSERT_TRUE(files.commit());
  EXPECT_EQ(fs::status(secret).permissions(), fs::perms{0600});
}

TEST_F(StagedFilesTest, ClearAwayWhatKilledProcessesLeft) {
  write(".bitr-123-4.tmp", "half of");
  write(".bitr-notes.tmp", "somebody's own");
  const fs::path used = write(".bitr-123-5.tmp", "half of");
  const Descriptor writer(::open(used.c_str(), O_WRONLY | O_CLOEXEC));
  ASSERT_EQ(::flock(writer.get(), LOCK_EX), 0);
  StagedFiles files;
  ASSERT_TRUE(files.add(folder_ / "a", bytes("a")));
  ASSERT_TRUE(files.commit());
  EXPECT_EQ(names(), (Names{".bitr-123-5.tmp", ".bitr-notes.tmp", "a"}));
}

TEST_F(StagedFilesTest, AreNotTakenForOrphansByOthers) {
  StagedFiles files;
  ASSERT_TRUE(files.add(folder_ / "a", bytes("a")));
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const Descriptor other(::open(entry.path().c_str(), O_RDWR | O_CLOEXEC));
    EXPECT_NE(::flock(other.get(), LOCK_EX | LOCK_NB), 0);
  }
  ASSERT_TRUE(files.commit());
  EXPECT_EQ(content("a"), "a");
}

}  // namespace
}  // namespace bitr::io
