#include "fuzz_geometry.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)bitr::io::fuzz_geometry(data, size, bitr::io::CloudFormat::obj);
  return 0;
}
