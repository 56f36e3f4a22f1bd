#include <bitr/device.hpp>

#include "cpu/thread_pool.hpp"

namespace bitr {

const std::string& Device::name() const { return pool_->processor(); }
unsigned Device::threads() const { return pool_->threads(); }

Device cpu_device(unsigned threads) { return Device(std::make_shared<cpu::ThreadPool>(threads)); }

}  // namespace bitr
