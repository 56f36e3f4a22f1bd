// The Vulkan device that tests run on, and operations run on it.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/failure.hpp"
#include "support/op_run.hpp"
#include "vk/executor.hpp"

namespace bitr::test {

/// The environment's BITR_TIER.
inline std::optional<Tier> asked_tier() {
  const char* text = std::getenv("BITR_TIER");
  if (!text || !*text) return std::nullopt;
  const auto tier = tier_named(text);
  if (!tier) throw Failure(ErrorCode::invalid_argument, std::string("BITR_TIER=") + text);
  return tier;
}

/// One device for the whole program: the best one the loader shows (VK_DRIVER_FILES chooses the driver).
/// BITR_VALIDATE=core|sync|gpu puts the validation layers in between; the program then fails if they
/// complain. BITR_TIER asks for a tier, and the program fails on a device that cannot execute it. Null where
/// there is no Vulkan.
inline const std::shared_ptr<vk::Context>& vulkan() {
  // Never destroyed: drivers that are unloaded look leaky to sanitizers.
  static const auto& context = *new std::shared_ptr<vk::Context>([]() -> std::shared_ptr<vk::Context> {
    const char* text = std::getenv("BITR_VALIDATE");
    const std::string validate = text ? text : "";
    vk::OwnDevice wanted;
    wanted.validate = !validate.empty();
    wanted.validate_synchronization = validate == "sync";
    wanted.validate_on_gpu = validate == "gpu";
    wanted.tier = asked_tier();
    try {
      return std::make_shared<vk::Context>(wanted);
    } catch (const Failure& failure) {
      if (failure.error().code == ErrorCode::no_device) return nullptr;
      throw;
    }
  }());
  return context;
}

/// Fails the program if the validation layers said anything. Leaves the names of the shaders that ran in the
/// file that BITR_SHADERS_RUN names, for every_shader_runs.
class ValidationCheck : public testing::Environment {
 public:
  void TearDown() override {
    if (!vulkan()) return;
    if (const char* file = std::getenv("BITR_SHADERS_RUN")) {
      std::ofstream out(file);
      for (const std::string& shader : vulkan()->shaders()) out << shader << '\n';
      EXPECT_TRUE(out.flush()) << file;
    }
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
  vk::Executor executor(vulkan(), graph_of(op, inputs, outputs), layout, {.guard_bytes = guard_bytes});
  return run_node(executor, layout, inputs, outputs.size());
} catch (const Failure& failure) {
  ADD_FAILURE() << failure.what();
  return {};
}

}  // namespace bitr::test
