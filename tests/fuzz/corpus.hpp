// What make_corpus.cpp's writers of seeds share.
#pragma once

#include <string_view>

/// Writes one seed: a file of the corpus of `parser`.
using WriteSeed = void (*)(std::string_view parser, std::string_view file, std::string_view bytes);

void write_weight_seeds(WriteSeed seed);  ///< safetensors, pickle, torch_checkpoint
