// The measured tensors of the official code: cases and weights, from the committed data, or from
// ../shared/golden when that is there.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <bitr/io.hpp>
#include <bitr/pose.hpp>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cpu/executor.hpp"
#include "io/safetensors.hpp"
#include "model/build.hpp"
#include "model/load.hpp"
#include "support/paths.hpp"

namespace bitr::test {

inline std::filesystem::path golden_path(const std::string& file) {
  const std::filesystem::path committed = data_dir() / "golden" / file;
  if (std::filesystem::exists(committed)) return committed;
  return source_dir() / ".." / "shared" / "golden" / file;
}

inline TensorMap read_tensors(const std::filesystem::path& path) {
  const auto bytes = io::read_file(path);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message);
  auto map = io::parse_safetensors(*bytes, path.string());
  EXPECT_TRUE(map) << (map ? "" : map.error().message);
  return std::move(*map);
}

inline std::string case_file(int number) {
  return "case_" + std::string(number < 10 ? "0" : "") + std::to_string(number) + ".safetensors";
}

inline const std::vector<int> all_cases = {0, 1, 2, 3, 4, 6, 7, 9, 11};

/// One case: inputs, the official tensors and the model they were made with.
struct GoldenCase {
  int number;
  TensorMap tensors;
  model::Weights weights;

  static bool available(int number) {
    if (!std::filesystem::exists(golden_path(case_file(number)))) return false;
    return std::filesystem::exists(golden_path(weights_file(number)));
  }
  static std::string weights_file(int number) {
    const int set = number == 0 ? 0 : (number == 2 || number == 7 || number == 9 ? 2 : 1);
    return "weights_0" + std::to_string(set) + ".safetensors";
  }
  static GoldenCase load(int number) { return load(number, case_file(number)); }
  static GoldenCase load(int number, const std::string& file) {
    GoldenCase golden{number, read_tensors(golden_path(file)), {}};
    const std::string name = weights_file(number);
    auto weights = model::weights_from_tensors(read_tensors(golden_path(name)), {.name = name, .mode = {}});
    EXPECT_TRUE(weights) << (weights ? "" : weights.error().message);
    golden.weights = std::move(*weights);
    return golden;
  }

  bool has(const std::string& name) const { return tensors.tensors.count(name) != 0; }
  const Tensor& at(const std::string& name) const { return tensors.tensors.at(name); }
  std::vector<double> values(const std::string& name) const { return at(name).to_double(); }

  graph::BatchLayout layout() const {
    std::vector<std::uint32_t> sizes;
    for (const char* name : {"in.src_counts", "in.ref_counts"})
      for (double n : values(name)) sizes.push_back(static_cast<std::uint32_t>(n));
    return {sizes, static_cast<std::uint32_t>(weights.config.num_key_points)};
  }

  /// Rows of the source clouds, then of the reference clouds.
  std::vector<double> both(const std::string& what) const {
    std::vector<double> rows = values("in.src_" + what);
    const auto reference = values("in.ref_" + what);
    rows.insert(rows.end(), reference.begin(), reference.end());
    return rows;
  }

  /// An input's rows; throws for an input that no case has.
  std::vector<double> input(graph::Input role) const {
    static const std::map<graph::Input, std::string> names = {{graph::Input::positions, "points"},
                                                              {graph::Input::normals, "normals"}};
    return both(names.at(role));
  }

  /// Lays out the batch and copies the clouds.
  void fill(graph::Executor& executor) const {
    executor.prepare(layout());
    for (const auto& [role, id] : executor.graph().inputs)
      if (role != graph::Input::truth) executor.write(id, input(role));
  }
  void run(graph::Executor& executor) const {
    fill(executor);
    executor.run();
  }
};

/// Rotation of pair p in a pose tensor row.
template <class T>
Pose pose_of(const T* row) {
  Pose pose;
  for (int i = 0; i < 9; ++i) pose.rotation[i] = static_cast<double>(row[i]);
  for (int i = 0; i < 3; ++i) pose.translation[i] = static_cast<double>(row[9 + i]);
  return pose;
}

inline Pose golden_pose(const GoldenCase& golden, std::size_t pair) {
  const auto R = golden.values("out.R"), t = golden.values("out.t");
  Pose pose;
  std::copy_n(R.begin() + 9 * pair, 9, pose.rotation.begin());
  std::copy_n(t.begin() + 3 * pair, 3, pose.translation.begin());
  return pose;
}

}  // namespace bitr::test
