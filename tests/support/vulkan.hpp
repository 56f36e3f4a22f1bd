// The Vulkan device that tests run on, and operations run on it.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "core/failure.hpp"
#include "support/op_run.hpp"
#include "vk/executor.hpp"

namespace bitr::test {

/// One device for the whole program: the best one the loader shows (VK_DRIVER_FILES chooses the driver).
/// BITR_VALIDATE=core|sync|gpu puts the validation layers in between; the program then fails if they
/// complain. Null where there is no Vulkan.
inline const std::shared_ptr<vk::Context>& vulkan() {
  // Never destroyed: drivers that are unloaded look leaky to sanitizers.
  static const auto& context = *new std::shared_ptr<vk::Context>([]() -> std::shared_ptr<vk::Context> {
    const char* text = std::getenv("BITR_VALIDATE");
    const std::string validate = text ? text : "";
    vk::OwnDevice wanted;
    wanted.validate = !validate.empty();
    wanted.validate_synchronization = validate == "sync";
    wanted.validate_on_gpu = validate == "gpu";
    try {
      return std::make_shared<vk::Context>(wanted);
    } catch (const Failure& failure) {
      if (failure.error().code == ErrorCode::no_device) return nullptr;
      throw;
    }
  }());
  return context;
}

/// Fails the program if the validation layers said anything.
class ValidationCheck : public testing::Environment {
 public:
  void TearDown() override {
    if (!vulkan()) return;
    for (const std::string& message : vulkan()->validation_messages())
      // What GPU-assisted validation says of a device without 64-bit integers when it begins.
      if (message.find("shaderInt64 feature is not available") == std::string::npos) ADD_FAILURE() << message;
  }
};
inline testing::Environment* const validation_check = testing::AddGlobalTestEnvironment(new ValidationCheck);

/// Runs `op` on the device; expects the memory around every tensor untouched; returns the outputs, or none
/// after a failure.
inline std::vector<OpTensor> run_op_vulkan(const ops::Op& op, const graph::BatchLayout& layout,
                                           const std::vector<OpTensor>& inputs,
                                           const std::vector<OpTensor>& outputs) try {
  graph::Graph graph;
  graph::Node node{"op", op, {}, {}};
  const auto add = [&](const OpTensor& tensor) {
    return graph.add({.name = "t" + std::to_string(graph.tensors.size()),
                      .rows = tensor.rows,
                      .per_row = tensor.per_row,
                      .width = tensor.width,
                      .kind = tensor.index ? graph::ElementKind::index : graph::ElementKind::real,
                      .fiber = {}});
  };
  for (const OpTensor& tensor : inputs) node.inputs.push_back(add(tensor));
  for (const OpTensor& tensor : outputs) node.outputs.push_back(add(tensor));
  graph.nodes.push_back(node);
  vk::Executor executor(vulkan(), graph, layout, {.guard_bytes = 256});
  executor.prepare(layout);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    float* to = executor.input(node.inputs[i]);
    if (inputs[i].index) {
      std::copy(inputs[i].indices.begin(), inputs[i].indices.end(), reinterpret_cast<std::uint32_t*>(to));
      continue;
    }
    const std::size_t width = static_cast<std::size_t>(inputs[i].width), stride = vk::padded(inputs[i].width);
    for (std::size_t j = 0; j < inputs[i].values.size(); ++j)
      to[j / width * stride + j % width] = static_cast<float>(inputs[i].values[j]);
  }
  executor.run();
  std::vector<OpTensor> results;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    OpTensor result = outputs[i];
    if (result.index) {
      result.indices = executor.indices(node.outputs[i]);
    } else {
      const auto values = executor.real(node.outputs[i]);
      result.values.assign(values.begin(), values.end());
    }
    results.push_back(std::move(result));
  }
  EXPECT_TRUE(executor.guards_hold()) << "written outside an output";
  return results;
} catch (const Failure& failure) {
  ADD_FAILURE() << failure.what();
  return {};
}

}  // namespace bitr::test
