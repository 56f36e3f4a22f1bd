// A log that is taken up again: what is kept, what is refused, what is noticed.
#include "io/line_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "core/failure.hpp"

namespace bitr::io {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LineLogTest : public testing::Test {
 protected:
  LineLogTest() {
    std::string name = (fs::temp_directory_path() / "bitr-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    file_ = folder_ / "log";
  }
  ~LineLogTest() override { fs::remove_all(folder_); }

  void write(const std::string& text) const { std::ofstream(file_) << text; }
  std::string content() const {
    std::ifstream stream(file_);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  static bool all(std::string_view, bool) { return true; }
  template <class Body>
  static std::string failure(Body body) {
    try {
      body();
    } catch (const Failure& failure) {
      return failure.what();
    }
    return "no failure";
  }

  fs::path folder_, file_;
};

TEST_F(LineLogTest, KeepsWholeLinesUpToARefusedOne) {
  write("one\ntwo\nthree\nfour\nhal");
  std::vector<std::pair<std::string, bool>> seen;
  const auto keep = [&](std::string_view line, bool whole) {
    seen.emplace_back(line, whole);
    return line != "four";
  };
  LineLog log(file_, keep);
  EXPECT_EQ(seen, (std::vector<std::pair<std::string, bool>>{
                      {"one", true}, {"two", true}, {"three", true}, {"four", true}}));
  log.append("five\n");
  EXPECT_EQ(content(), "one\ntwo\nthree\nfive\n");
}

TEST_F(LineLogTest, CutsOffWhatIsUnfinished) {
  // Longer than it is read at once.
  const std::string longest(200'000, 'x');
  write(longest + "\nhal");
  std::vector<bool> whole;
  LineLog(file_, [&](std::string_view line, bool is_whole) {
    EXPECT_EQ(line, is_whole ? longest : "hal");
    whole.push_back(is_whole);
    return true;
  });
  EXPECT_EQ(whole, (std::vector<bool>{true, false}));
  EXPECT_EQ(content(), longest + "\n");
}

TEST_F(LineLogTest, LeavesAloneWhatItsReaderRefuses) {
  write("one\ntwo");
  const auto refuse = [](std::string_view, bool whole) -> bool {
    if (!whole) throw Failure(ErrorCode::invalid_argument, "not mine");
    return true;
  };
  EXPECT_EQ(failure([&] { LineLog(file_, refuse); }), "not mine");
  EXPECT_EQ(content(), "one\ntwo");
}

TEST_F(LineLogTest, NoticesThatItsFileIsGone) {
  LineLog log(file_, all);
  log.append("one\n");
  fs::remove(file_);
  EXPECT_EQ(failure([&] { log.append("two\n"); }),
            file_.string() + ": cannot write: No such file or directory");
  write("another");
  EXPECT_THAT(failure([&] { log.append("two\n"); }), HasSubstr("was replaced by another file"));
  EXPECT_EQ(content(), "another");
}

TEST_F(LineLogTest, GoesThroughLinksToFilesAlone) {
  const fs::path target = folder_ / "target";
  fs::create_symlink("target", file_);
  EXPECT_EQ(failure([&] { LineLog(file_, all); }), file_.string() + ": is a symbolic link to nothing");
  EXPECT_FALSE(fs::exists(target));
  std::ofstream(target) << "one\n";
  LineLog(file_, all).append("two\n");
  EXPECT_EQ(content(), "one\ntwo\n");
  EXPECT_TRUE(fs::is_symlink(file_));
}

TEST_F(LineLogTest, DoesNotWaitForAPipe) {
  ASSERT_EQ(::mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THAT(failure([&] { LineLog(file_, all); }), HasSubstr("is no regular file"));
}

}  // namespace
}  // namespace bitr::io
