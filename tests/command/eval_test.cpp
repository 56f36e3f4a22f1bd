#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/io.hpp>
#include <bitr/model.hpp>
#include <cmath>
#include <map>
#include <set>
#include <sstream>

#include "run_command.hpp"

namespace bitr::test {
namespace {

using testing::HasSubstr;

using Words = std::vector<std::string>;

/// One line of the CSV by column names. No name here needs quotes.
using Line = std::map<std::string, std::string>;

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> fields;
  std::istringstream stream(text);
  for (std::string field; std::getline(stream, field, at);) fields.push_back(field);
  if (at == ',' && text.ends_with(at)) fields.emplace_back();
  return fields;
}

std::vector<Line> read_csv(const std::string& path) {
  std::vector<Line> lines;
  const std::vector<std::string> rows = split(read_text(path), '\n');
  const std::vector<std::string> names = split(rows.at(0), ',');
  for (std::size_t row = 1; row < rows.size(); ++row) {
    const std::vector<std::string> fields = split(rows[row], ',');
    EXPECT_EQ(fields.size(), names.size()) << rows[row];
    Line line;
    for (std::size_t i = 0; i < std::min(fields.size(), names.size()); ++i) line[names[i]] = fields[i];
    lines.push_back(std::move(line));
  }
  return lines;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return (values[(values.size() - 1) / 2] + values[values.size() / 2]) / 2;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// Every row of the JSON is what the lines of the CSV amount to.
void expect_agreement(const nlohmann::json& json, const std::vector<Line>& lines) {
  for (const auto& row : json["rows"]) {
    std::vector<double> dr, fraction;
    for (const Line& line : lines) {
      if (line.at("method") != row["method"] || line.at("protocol") != row["protocol"]) continue;
      if (!row["share"].is_null() && std::stod(line.at("share")) != row["share"]) continue;
      if (std::stoull(line.at("points")) != row["points"]) continue;
      const double overlap = std::stod(line.at("overlap"));
      if (!row["overlap"].is_null() && !(row["overlap"][0] <= overlap && overlap < row["overlap"][1]))
        continue;
      dr.push_back(std::stod(line.at("dr")));
      fraction.push_back(std::stod(line.at("dt_fraction")));
    }
    const std::string what = row.dump();
    ASSERT_FALSE(dr.empty()) << what;
    EXPECT_EQ(row["pairs"], dr.size()) << what;
    EXPECT_NEAR(row["dr"]["median"], median(dr), 1e-9) << what;
    EXPECT_NEAR(row["dr"]["mean"], mean(dr), 1e-9) << what;
    EXPECT_NEAR(row["dt_fraction"]["median"], median(fraction), 1e-12) << what;
    double success = 0, flips = 0;
    for (std::size_t i = 0; i < dr.size(); ++i) {
      success += dr[i] <= 15 && fraction[i] <= 0.3;
      flips += dr[i] > 135;
    }
    const auto count = static_cast<double>(dr.size());
    EXPECT_NEAR(row["success"]["15deg_0.3"], success / count, 1e-12) << what;
    EXPECT_NEAR(row["flips"], flips / count, 1e-12) << what;
  }
}

TEST(Eval, JsonIsWhatTheCsvAmountsTo) {
  const Folder folder;
  const std::string json = folder.path("errors.json"), csv = folder.path("pairs.csv");
  const Finished finished = run_command(
      {"eval",      "--kind",           "aircraft", "--share", "1,0.7", "--points", "300", "--noise",
       "0",         "--samples",        "11",       "--batch", "4",     "--seed",   "3",   "--same-points",
       "--methods", "identity,pca-icp", "--json",   json,      "--csv", csv});
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_EQ(finished.err, "");
  EXPECT_THAT(finished.out, HasSubstr("opposed, s = 0.7, 300 points: 11 pairs"));
  EXPECT_THAT(finished.out, HasSubstr("pca-icp"));
  const auto result = read_json(json);
  const std::vector<Line> lines = read_csv(csv);
  ASSERT_EQ(result["rows"].size(), 4u);
  ASSERT_EQ(lines.size(), 44u);
  expect_agreement(result, lines);
  EXPECT_EQ(result["kind"], "aircraft");
  EXPECT_EQ(result["split"], "test");
  EXPECT_NEAR(result["rows"][2]["icp_keep"], 0.4 / 0.7, 1e-12);

  // A whole copy is what principal axes solve, and nobody else does by standing still.
  const auto& identity = result["rows"][0];
  const auto& axes = result["rows"][1];
  EXPECT_EQ(axes["method"], "pca-icp");
  EXPECT_LE(axes["dr"]["median"], 1e-6);
  EXPECT_EQ(axes["success"]["5deg_0.1"], 1);
  EXPECT_GT(identity["dr"]["median"], 60);
  EXPECT_EQ(identity["success"]["5deg_0.1"], 0);

  // Every method has the same pairs, each a shape of its own.
  std::set<std::string> shapes;
  for (const Line& line : lines) shapes.insert(line.at("shape"));
  EXPECT_EQ(shapes.size(), 11u);
}

TEST(Eval, SamePairsWhateverTheBatchAndTheThreads) {
  const Folder folder;
  const auto evaluated = [&](const std::string& name, const Words& more) {
    Words words = {"eval",
                   "--kind",
                   "vessels",
                   "--points",
                   "120",
                   "--samples",
                   "5",
                   "--methods",
                   "pca-icp,complete-match+icp",
                   "--backend",
                   "cpu",
                   "--csv",
                   folder.path(name)};
    words.insert(words.end(), more.begin(), more.end());
    const Finished finished = run_command(words);
    EXPECT_EQ(finished.status, 0) << finished.err;
    EXPECT_THAT(finished.out, HasSubstr("break, 120 points: 5 pairs"));
    return read_text(folder.path(name));
  };
  const std::string one = evaluated("one", {"--batch", "1", "--threads", "1"});
  EXPECT_EQ(one, evaluated("all", {"--batch", "8", "--threads", "3"}));
  EXPECT_THAT(one, HasSubstr("complete-match+icp"));
  EXPECT_NE(one, evaluated("other", {"--seed", "1"}));
}

TEST(Eval, ComparesModelsAndBinsByOverlap) {
  const Folder folder, models, again;
  for (const Folder* place : {&models, &again})
    ASSERT_TRUE(io::write_file(place->path("net.safetensors"),
                               serialize(untrained_model({}, place == &models ? 1 : 2).value())));
  const std::string json = folder.path("errors.json"), csv = folder.path("pairs.csv");
  // A list does not swallow what follows it.
  const Finished finished =
      run_command(split("eval " + models.path("net.safetensors") +
                            " --icp --kind aircraft --protocol independent "
                            "--samples 6 --backend cpu --share 0.5 --points 100,150 " +
                            again.path("net.safetensors") + " --json " + json + " --csv " + csv,
                        ' '));
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto result = read_json(json);
  EXPECT_THAT(result["models"].size(), 2u);
  std::set<std::string> methods;
  std::size_t binned = 0;
  for (const auto& row : result["rows"]) {
    methods.insert(row["method"].get<std::string>());
    if (!row["overlap"].is_null() && row["method"] == models.path("net.safetensors"))
      binned += row["pairs"].get<std::size_t>();
  }
  EXPECT_EQ(methods, (std::set<std::string>{models.path("net.safetensors"), again.path("net.safetensors"),
                                            models.path("net.safetensors") + "+icp",
                                            again.path("net.safetensors") + "+icp"}));
  EXPECT_EQ(binned, 12u);
  expect_agreement(result, read_csv(csv));
}

TEST(Eval, FoldersOfShapesAndWhatIsSkipped) {
  const Folder shapes, folder;
  const PairFiles files = generate_files(shapes, "copy", "400");
  shapes.write("broken.ply", "ply\n");
  const Finished finished = run_command({"eval", "--data", shapes.path(), "--split", "all", "--points", "100",
                                         "--samples", "6", "--methods", "identity", "--json", "-"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  EXPECT_THAT(finished.err, HasSubstr("opposed, s = 0.7, 100 points: 6 pairs"));
  EXPECT_THAT(finished.err, HasSubstr("1 shape was skipped; broken.ply"));
  const auto result = nlohmann::json::parse(finished.out);
  EXPECT_EQ(result["data"], shapes.path());
  EXPECT_EQ(result["skipped"].size(), 1u);
  EXPECT_EQ(result["rows"][0]["pairs"], 6);

  const Finished few = run_command(
      {"eval", "--data", shapes.path(), "--points", "100", "--samples", "2", "--methods", "identity"});
  EXPECT_EQ(few.status, 0) << few.err;
  EXPECT_THAT(few.err, HasSubstr("too few to hold some back"));
}

TEST(Eval, ExplainsItself) {
  const Finished help = run_command({"eval", "--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_THAT(help.out, HasSubstr("Examples:"));
  EXPECT_THAT(help.out, HasSubstr("--protocol"));
}

TEST(Eval, WhatIsWrongIsStatusTwoAndOneLine) {
  const Folder folder;
  const std::string garbage = folder.write("garbage.safetensors", "no weights");
  struct Case {
    Words words;
    const char* says;
  };
  const std::vector<Case> cases = {
      {{}, "--kind, --data or --pairs"},
      {{"--kind", "aircraft", "--data", "."}, "give one of them"},
      {{"--kind", "tables"}, "tables"},
      {{"--data", folder.path("absent")}, "absent"},
      {{"--data", folder.path(), "--split", "test", "--methods", "identity"}, "no mesh or cloud in it"},
      {{folder.path("absent.safetensors"), "--kind", "aircraft"}, "absent.safetensors"},
      {{garbage, "--kind", "aircraft"}, "garbage.safetensors"},
      {{"--kind", "aircraft", "--methods", "identity,magic"}, "\"magic\" is not one of"},
      {{"--kind", "aircraft", "--protocol", "sideways"}, "sideways"},
      {{"--kind", "aircraft", "--share", "0.7,0"}, "--share 0.0"},
      {{"--kind", "aircraft", "--share", "0.7,half"}, "half"},
      {{"--kind", "aircraft", "--protocol", "complement", "--share", "1"}, "share"},
      {{"--kind", "vessels", "--share", "0.7"}, "--share needs a --protocol"},
      {{"--kind", "aircraft", "--samples", "0"}, "--samples"},
      {{"--kind", "aircraft", "--points", "1"}, "--points"},
      {{"--kind", "aircraft", "--points", "20", "--methods", "complete-match"}, "complete-match"},
      {{"--kind", "aircraft", "--noise", "-1"}, "noise"},
      {{"--kind", "aircraft", "--keep", "0"}, "--keep 0.0"},
      {{"--kind", "aircraft", "--json", folder.path("no/such.json")}, "its folder does not exist"},
      {{"--kind", "aircraft", "--csv", folder.path("no/such.csv")}, "its folder does not exist"},
      {{"--kind", "aircraft", "--csv", "-"}, "--csv"},
      {{"--kind", "aircraft", "--csv", folder.path("a"), "--json", folder.path("a")},
       "is the file of --csv too"},
      {{garbage, "--kind", "aircraft", "--csv", garbage}, "would replace an input"},
  };
  for (const Case& c : cases) {
    Words words = {"eval", "--samples", "2"};
    if (std::find(c.words.begin(), c.words.end(), "--samples") != c.words.end()) words.resize(1);
    words.insert(words.end(), c.words.begin(), c.words.end());
    const Finished finished = run_command(words);
    const std::string name = testing::PrintToString(words);
    EXPECT_EQ(finished.status, 2) << name;
    EXPECT_THAT(finished.err, testing::StartsWith("bitr: ")) << name;
    EXPECT_THAT(finished.err, HasSubstr(c.says)) << name;
    EXPECT_EQ(std::count(finished.err.begin(), finished.err.end(), '\n'), 1) << finished.err;
    EXPECT_EQ(finished.out, "") << name;
  }
  EXPECT_EQ(folder.names(), Words{"garbage.safetensors"});
}

TEST(Eval, TakesPairsOfAManifestAndMovesThem) {
  const Folder folder;
  ASSERT_EQ(
      run_command({"generate", "copy", "--out", folder.path(), "--count", "2", "--points", "300"}).status, 0);
  const std::string json = folder.path("errors.json"), csv = folder.path("errors.csv");
  const Finished finished =
      run_command({"eval", "--pairs", folder.path("copy.jsonl"), "--methods", "identity,complete-match",
                   "--points", "300", "--samples", "6", "--json", json, "--csv", csv, "--confidence"});
  ASSERT_EQ(finished.status, 0) << finished.err;
  const auto lines = read_csv(csv);
  ASSERT_EQ(lines.size(), 12);
  std::set<std::string> turns;
  for (const Line& line : lines) {
    EXPECT_EQ(line.at("protocol"), "pairs");
    if (line.at("method") == "identity") {
      turns.insert(line.at("dr"));
    } else {
      EXPECT_LT(std::stod(line.at("dr")), 0.1);
      EXPECT_NEAR(std::stod(line.at("overlap")), 1, 1e-9);
      EXPECT_GT(std::stod(line.at("confidence")), 0.5);
    }
  }
  EXPECT_EQ(turns.size(), 6) << "each sample is moved anew";
  const auto report = read_json(json);
  expect_agreement(report, lines);
  EXPECT_EQ(report["confidence"]["identity"]["was"], 0);
  EXPECT_EQ(report["confidence"]["complete-match"]["was"], 1);

  const auto fails = [&](const Words& more, const std::string& why) {
    Words words = {"eval", "--pairs"};
    words.insert(words.end(), more.begin(), more.end());
    const Finished failed = run_command(words);
    EXPECT_EQ(failed.status, 2);
    EXPECT_THAT(failed.err, HasSubstr(why));
  };
  const std::string bare =
      folder.write("bare.csv", "source,reference\ncopy_000_source.ply,copy_000_reference.ply\n");
  fails({bare}, "pair 0 has no truth to be compared with");
  fails({folder.write("none.jsonl", "")}, "none.jsonl: holds no pairs");
  fails({folder.path("copy.jsonl"), "--share", "0.5"}, "--pairs excludes --share");
  fails({folder.path("copy.jsonl"), "--kind", "copy"}, "--kind excludes --pairs");
}

}  // namespace
}  // namespace bitr::test
