#include <bitr/device.hpp>
#include <fstream>

#include "cpu/thread_pool.hpp"

namespace bitr {
namespace {

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0)
      if (const auto at = line.find(": "); at != std::string::npos) return line.substr(at + 2);
  return "CPU";
}

}  // namespace

const std::string& Device::name() const {
  static const std::string name = processor_name();
  return name;
}
unsigned Device::threads() const { return pool_->threads(); }

Device cpu_device(unsigned threads) { return Device(std::make_shared<cpu::ThreadPool>(threads)); }

}  // namespace bitr
