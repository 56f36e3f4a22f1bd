// Names, shapes, aliases and sizes of the official state dict.
#include <gtest/gtest.h>

#include <bitr/model.hpp>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "model/load.hpp"
#include "model/parameters.hpp"
#include "support/paths.hpp"

namespace bitr {
namespace {

struct Official {
  const char* section;  ///< start of its header in state_dict.txt
  ModelConfig config;
  std::size_t parameters;
};

std::vector<Official> official() {
  ModelConfig normals, bunny;
  normals.return_normals = true;
  bunny.key_global_merge_coe = 8;
  return {{"=== return_normals=0", {}, 161316},
          {"=== return_normals=1", normals, 164348},
          {"=== bunny", bunny, 172348}};
}

std::size_t count(const model::StateDict& dict) {
  std::size_t total = 0;
  for (const auto& spec : dict.parameters) {
    std::size_t size = 1;
    for (std::size_t n : spec.shape) size *= n;
    total += size;
  }
  return total;
}

TEST(StateDict, HasTheOfficialNumberOfParameters) {
  for (const Official& net : official()) {
    EXPECT_EQ(count(model::state_dict(net.config)), net.parameters) << net.section;
    const Model model = untrained_model(net.config).value();
    EXPECT_EQ(model.parameter_count(), net.parameters);
    EXPECT_EQ(model.tensor_count(), model::state_dict(net.config).parameters.size());
  }
}

TEST(StateDict, NamesAreUniqueAndAliasesPointAtParameters) {
  for (const Official& net : official()) {
    const auto dict = model::state_dict(net.config);
    std::set<std::string> names;
    for (const auto& spec : dict.parameters) EXPECT_TRUE(names.insert(spec.name).second) << spec.name;
    for (const auto& [alias, canonical] : dict.aliases) {
      EXPECT_FALSE(names.count(alias)) << alias;
      EXPECT_TRUE(names.count(canonical)) << canonical;
    }
  }
}

struct Entry {
  std::vector<std::size_t> shape;
  std::string alias_of;
  bool buffer = false;
};

// The lines of one section: name, shape, and "ALIAS_OF name" or "BUFFER", tab-separated.
std::map<std::string, Entry> listed(const std::filesystem::path& path, const std::string& section) {
  std::map<std::string, Entry> entries;
  std::ifstream file(path);
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("===", 0) == 0) inside = line.rfind(section, 0) == 0;
    if (!inside || line.rfind("===", 0) == 0 || line.rfind("---", 0) == 0 ||
        line.find('\t') == std::string::npos)
      continue;
    std::istringstream cells(line);
    std::string name, shape, note;
    std::getline(cells, name, '\t');
    std::getline(cells, shape, '\t');
    std::getline(cells, note, '\t');
    Entry entry;
    static const std::regex number("[0-9]+");
    for (std::sregex_iterator it(shape.begin(), shape.end(), number), end; it != end; ++it)
      entry.shape.push_back(std::stoul(it->str()));
    if (note.rfind("ALIAS_OF ", 0) == 0) entry.alias_of = note.substr(9);
    entry.buffer = note == "BUFFER";
    entries.emplace(name, entry);
  }
  return entries;
}

TEST(StateDict, EqualsTheOfficialOneNameByName) {
  const std::filesystem::path path =
      test::source_dir() / "../shared/golden/state_dict.txt";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
  std::size_t sections = 0;
  for (const Official& net : official()) {
    const auto entries = listed(path, net.section);
    if (entries.empty()) continue;  // one configuration is recorded by its size only
    ++sections;
    const auto dict = model::state_dict(net.config);
    EXPECT_EQ(dict.parameters.size() + dict.aliases.size() + dict.buffers.size(), entries.size());
    for (const auto& spec : dict.parameters) {
      const auto it = entries.find(spec.name);
      ASSERT_NE(it, entries.end()) << spec.name;
      EXPECT_EQ(it->second.shape, spec.shape) << spec.name;
      EXPECT_EQ(it->second.alias_of, "") << spec.name;
      EXPECT_FALSE(it->second.buffer) << spec.name;
    }
    for (const auto& [alias, canonical] : dict.aliases) {
      const auto it = entries.find(alias);
      ASSERT_NE(it, entries.end()) << alias;
      EXPECT_EQ(it->second.alias_of, canonical) << alias;
    }
    for (const std::string& buffer : dict.buffers) {
      const auto it = entries.find(buffer);
      ASSERT_NE(it, entries.end()) << buffer;
      EXPECT_TRUE(it->second.buffer);
    }
  }
  EXPECT_GE(sections, 2u);
}

TEST(UntrainedModel, IsTheSameForTheSameSeed) {
  const Model a = untrained_model({}, 7).value(), b = untrained_model({}, 7).value(),
              c = untrained_model({}, 8).value();
  EXPECT_EQ(serialize(a), serialize(b));
  EXPECT_NE(serialize(a), serialize(c));
  EXPECT_FALSE(a.trained());
  EXPECT_EQ(a.name(), "untrained(7)");
  EXPECT_EQ(a.mode(), Mode::scale_exact);
}

// The official initialisation: uniform within bounds of the fan-in, normal linear maps, norms that do
// nothing.
TEST(UntrainedModel, FollowsTheOfficialInitialisation) {
  const auto weights = model::initial_weights({}, 3, Mode::scale_exact);
  for (const auto& spec : model::state_dict({}).parameters) {
    const Eigen::ArrayXXd values = weights.parameters.at(spec.name).array();
    const auto ends_with = [&](const std::string& end) {
      return spec.name.size() >= end.size() &&
             spec.name.compare(spec.name.size() - end.size(), end.size(), end) == 0;
    };
    if (ends_with("normalization.weight") || ends_with("mean_scale")) {
      EXPECT_TRUE((values == 1).all()) << spec.name;
    } else if (ends_with("normalization.bias")) {
      EXPECT_TRUE((values == 0).all()) << spec.name;
    } else if (ends_with("net.3.weight") || ends_with("net.6.weight")) {
      const double bound = std::sqrt(6.0 / 32);
      EXPECT_LE(values.abs().maxCoeff(), bound) << spec.name;
      if (values.size() < 1000) continue;
      EXPECT_GT(values.abs().maxCoeff(), 0.98 * bound) << spec.name;
      EXPECT_NEAR(values.square().mean(), bound * bound / 3, 0.1 * bound * bound / 3) << spec.name;
    } else if (ends_with("net.3.bias") || ends_with("net.6.bias")) {
      EXPECT_LE(values.abs().maxCoeff(), 1 / std::sqrt(32.0)) << spec.name;
      EXPECT_GT(values.abs().maxCoeff(), 0) << spec.name;
    }
  }
}

}  // namespace
}  // namespace bitr
