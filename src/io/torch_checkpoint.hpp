// PyTorch checkpoints without PyTorch: the zip archive of `torch.save`, whose pickle is read by a machine
// that can only build tensors, dicts, lists, tuples, strings and numbers.
#pragma once

#include <bitr/result.hpp>
#include <span>
#include <string_view>

#include "core/tensor.hpp"

namespace bitr::io {

/// Reads a state dict: either the top-level dict, or its "model_state_dict" / "state_dict" entry; whatever
/// else a checkpoint holds is parsed and dropped. Views with arbitrary strides are made contiguous, tensors
/// that share a storage each come out whole. `bad_file` names the opcode or global that is refused, the entry
/// or the tensor and the limit; `unsupported` are TorchScript archives, big-endian ones and the format before
/// PyTorch 1.6.
Result<TensorMap> parse_torch_checkpoint(std::span<const std::byte> bytes, std::string_view name);

}  // namespace bitr::io
