// Schedules that run once.
#pragma once

#include "vk/commands.hpp"

namespace bitr::vk {

class Submitter {
 public:
  explicit Submitter(const Context& context) : context_(context), recorder_(context), commands_(context) {}

  /// Records, submits in parts of at most most_cost, and waits: the host then sees what copies wrote. Throws
  /// as Commands do.
  void run(const Schedule& schedule);

 private:
  const Context& context_;
  Recorder recorder_;
  Commands commands_;  // last: waits for the device before anything else goes
};

}  // namespace bitr::vk
