#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;

struct Case {
  std::string what;
  std::vector<std::string> words;  ///< after `assemble`
  std::string says;
};

class BadInput : public testing::Test {
 protected:
  void refuse(const Case& bad) {
    SCOPED_TRACE(bad.what);
    const auto before = folder.names();
    std::vector<std::string> words = {"assemble"};
    words.insert(words.end(), bad.words.begin(), bad.words.end());
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 2);
    EXPECT_THAT(finished.err, testing::MatchesRegex("bitr: [^\n]*\n"));
    EXPECT_THAT(finished.err, HasSubstr(bad.says));
    EXPECT_EQ(finished.out, "");
    EXPECT_EQ(folder.names(), before) << "something was written";
  }
  std::vector<std::string> with(const std::string& source, const std::string& reference) const {
    return {source,
            reference,
            "--complete-match",
            "-o",
            folder.path("out.ply"),
            "--json",
            folder.path("out.json")};
  }

  Folder folder;
  PairFiles good = generate_files(folder, "copy", "100");
};

TEST_F(BadInput, Clouds) {
  std::string equal, far;
  for (int i = 0; i < 100; ++i) equal += "1 2 3\n";
  const std::vector<std::pair<std::string, std::string>> files = {
      {"missing.ply", ""},
      {"empty.ply", folder.write("empty.ply", "")},
      {"empty.xyz", folder.write("empty.xyz", "")},
      {"empty.npy", folder.write("empty.npy", "")},
      {"junk.ply", folder.write("junk.ply",
                                "\x7f"
                                "ELF and so on\n")},
      {"junk.pcd", folder.write("junk.pcd", std::string(1000, '\0'))},
      {"junk.npy", folder.write("junk.npy", std::string(1000, '\xff'))},
      {"junk.xyz", folder.write("junk.xyz", "1 2 3\nfour five six\n")},
      {"junk.obj", folder.write("junk.obj", "f 1 2 3\n")},
      {"huge.ply", folder.write("huge.ply",
                                "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000000\n"
                                "property float x\nproperty float y\nproperty float z\nend_header\n")},
      {"few.xyz", folder.write("few.xyz", "0 0 0\n1 0 0\n0 1 0\n0 0 1\n")},
      {"equal.xyz", folder.write("equal.xyz", equal)},
      {"nan.xyz", folder.write("nan.xyz", "1 2 3\n1 nan 3\n")},
      {"infinite.xyz", folder.write("infinite.xyz", "1 2 3\n1 inf 3\n")},
      {"cloud.doc", folder.write("cloud.doc", "1 2 3\n")},
      {"flat.obj", folder.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")},
  };
  for (const auto& [name, path] : files) {
    refuse({name + " as source", with(folder.path(name), good.reference), name});
    refuse({name + " as reference", with(good.source, folder.path(name)), name});
  }
  refuse({"a folder", with(folder.path(), good.reference), folder.path()});
}

TEST_F(BadInput, Models) {
  const auto model = [&](const std::string& path) {
    return std::vector<std::string>{good.source, good.reference, "--model",
                                    path,        "-o",           folder.path("out.ply")};
  };
  refuse({"missing", model(folder.path("none.safetensors")), "none.safetensors"});
  refuse({"empty", model(folder.write("empty.safetensors", "")), "empty.safetensors"});
  refuse({"junk", model(folder.write("junk.safetensors", std::string(100, 'x'))), "junk.safetensors"});
  refuse({"a cloud", model(good.source), "copy_000_source.ply"});
}

TEST_F(BadInput, Options) {
  const auto option = [&](std::vector<std::string> extra) {
    extra.insert(extra.begin(), {good.source, good.reference, "--complete-match"});
    return extra;
  };
  refuse({"unknown", option({"--colour", "red"}), "--colour"});
  refuse({"a device of the CPU", option({"--backend", "cpu", "--device", "0"}), "--device 0"});
  refuse({"backend", option({"--backend", "abacus"}), "abacus"});
  refuse({"mode", option({"--mode", "exactly"}), "exactly"});
  refuse({"precision", option({"--precision", "f16"}), "f16"});
  refuse({"no points", option({"--points", "0"}), "--points"});
  refuse({"too few points", option({"--points", "10"}), "10"});
  refuse({"negative points", option({"--points", "-3"}), "-3"});
  refuse({"half a point", option({"--points", "2.5"}), "2.5"});
  refuse({"no number", option({"--seed", "monday"}), "monday"});
  refuse({"too many threads", option({"--threads", "100000"}), "100000"});
  refuse({"model and its seed", option({"--model", "m.safetensors", "--model-seed", "1"}), "--model"});
  refuse({"no truth", option({"--truth", folder.path("none.json")}), "none.json"});
  refuse({"junk truth", option({"--truth", folder.write("junk.json", "[1, 2")}), "junk.json"});
  refuse({"no pose", option({"--truth", folder.write("pose.json", R"({"transform": [[1]]})")}), "4×4"});
  refuse({"no rotation",
          option({"--truth",
                  folder.write("skew.json", R"({"transform": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]})")}),
          "rigid motion"});
}

TEST_F(BadInput, Outputs) {
  const auto output = [&](const std::string& option, const std::string& path) {
    return std::vector<std::string>{good.source, good.reference, "--complete-match", option, path};
  };
  std::filesystem::create_directory(folder.path("sub"));
  for (const std::string option : {"--output", "--image", "--view", "--json", "--profile"}) {
    refuse({"no such folder", output(option, folder.path("none/out")), "none/out"});
    refuse({"a folder", output(option, folder.path("sub")), "sub"});
    refuse({"an input", output(option, good.source), "input"});
    if (geteuid() != 0) refuse({"not allowed", output(option, "/proc/out"), "/proc/out"});
  }
  refuse({"a cloud on standard output", output("-o", "-"), "file"});
  refuse({"a picture on standard output", output("--image", "-"), "file"});
  refuse({"a page on standard output", output("--view", "-"), "file"});
  refuse({"a trace on standard output", output("--profile", "-"), "file"});
  const std::string same = folder.path("same");
  refuse(
      {"a trace into the result", {good.source, good.reference, "--profile", same, "--json", same}, "same"});
  refuse(
      {"a picture into the cloud", {good.source, good.reference, "-o", same, "--image", same}, "--output"});
  refuse(
      {"a picture into the result", {good.source, good.reference, "--image", same, "--json", same}, "same"});
  for (const std::string option : {"--output", "--image", "--json"})
    refuse(
        {"a page into another output", {good.source, good.reference, option, same, "--view", same}, option});
  refuse({"one file for both", {good.source, good.reference, "-o", same, "--json", same}, "same"});
}

TEST_F(BadInput, MessagesStayOnOneLine) {
  refuse({"newline in a name", with(folder.path("two\nlines.ply"), good.reference), "lines.ply"});
}

}  // namespace
}  // namespace bitr::test
