// Runs a fuzz target without libFuzzer: every seed, every prefix of a small seed, and damaged copies of it.
// The damage is drawn from a fixed generator, so a failure repeats.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "core/random.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

// An exact-size heap copy, so that a sanitizer sees a read one byte past the end.
void run(const std::uint8_t* data, std::size_t size) {
  const Bytes copy(data, data + size);
  LLVMFuzzerTestOneInput(copy.data(), copy.size());
}

void damage(Bytes& bytes, bitr::Random& random) {
  constexpr std::uint8_t telling[] = {0, 1, '\n', ' ', '-', '0', '9', 0x7f, 0x80, 0xff};
  const std::size_t at = random.below(bytes.size());
  switch (random.below(5)) {
    case 0:
      bytes[at] ^= static_cast<std::uint8_t>(1u << random.below(8));
      break;
    case 1:
      bytes[at] = telling[random.below(std::size(telling))];
      break;
    case 2:
      bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
      break;
    case 3:
      bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), telling[random.below(10)]);
      break;
    case 4:
      std::swap(bytes[at], bytes[random.below(bytes.size())]);
      break;
  }
}

void run_seed(const Bytes& seed) {
  constexpr std::size_t small = 4096, damaged_copies = 400;
  run(seed.data(), seed.size());
  if (seed.empty() || seed.size() > 64 * small) return;
  if (seed.size() <= small) {
    for (std::size_t size = 0; size < seed.size(); ++size) run(seed.data(), size);
  }
  bitr::Random random(seed.size());
  for (std::size_t copy = 0; copy < damaged_copies; ++copy) {
    Bytes bytes = seed;
    for (std::uint64_t hits = 1 + random.below(4); hits > 0 && !bytes.empty(); --hits) damage(bytes, random);
    run(bytes.data(), bytes.size());
  }
}

}  // namespace

int main(int argc, char** argv) {
  namespace fs = std::filesystem;
  std::vector<fs::path> files;
  for (int i = 1; i < argc; ++i) {
    if (fs::is_regular_file(argv[i])) files.emplace_back(argv[i]);
    if (!fs::is_directory(argv[i])) continue;
    for (const auto& entry : fs::recursive_directory_iterator(argv[i])) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& path : files) {
    std::ifstream stream(path, std::ios::binary);
    run_seed(Bytes(std::istreambuf_iterator<char>(stream), {}));
  }
  std::printf("%zu seeds\n", files.size());
  return files.empty() ? 1 : 0;
}
