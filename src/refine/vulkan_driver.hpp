// Refinements on a Vulkan device: what all of them want to know is found out together.
#pragma once

#include <span>

#include "core/thread_pool.hpp"
#include "refine/stepper.hpp"
#include "vk/device.hpp"

namespace bitr::refine {

/// To their ends. What each is told does not depend on the others. Throws Failure as vk::Submitter does.
void drive(std::span<Stepper* const> steppers, const vk::Context& context, ThreadPool& pool);

}  // namespace bitr::refine
