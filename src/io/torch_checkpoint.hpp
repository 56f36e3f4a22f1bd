// PyTorch checkpoints without PyTorch: the zip archive of `torch.save`, whose pickle is read by a machine that can
// only build tensors, dicts, lists, tuples, strings and numbers.
#pragma once

#include <bitr/result.hpp>
#include <span>
#include <string_view>

#include "core/tensor.hpp"

namespace bitr::io {

/// Reads a state dict: either the top-level dict, or its "model_state_dict" / "state_dict" entry. Views with
/// arbitrary strides are made contiguous. `bad_file` names the opcode or global that is refused.
Result<TensorMap> parse_torch_checkpoint(std::span<const std::byte> bytes, std::string_view name);

}  // namespace bitr::io
