// Writes the seed corpus: for each parser a folder of small files that between them use every feature it
// reads.
//   make_corpus OUTPUT_DIR   →   OUTPUT_DIR/ply/…, OUTPUT_DIR/pcd/…, …
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "cloud_seeds.hpp"
#include "corpus.hpp"

namespace {

std::filesystem::path output;

void seed(std::string_view parser, std::string_view file, std::string_view bytes) {
  const std::filesystem::path folder = output / parser;
  std::filesystem::create_directories(folder);
  std::ofstream(folder / file, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fputs("usage: make_corpus OUTPUT_DIR\n", stderr), 2;
  output = argv[1];
  write_weight_seeds(seed);
  for (const auto& [parser, file, bytes] : bitr::io::cloud_seeds()) seed(parser, file, bytes);
}
