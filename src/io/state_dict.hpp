// From a checkpoint's pickle to named tensors: which dict holds them, and their bytes in row-major order.
#pragma once

#include <functional>
#include <span>

#include "io/pickle.hpp"

namespace bitr::io {

/// The bytes of the storage `key`, which has exactly `size` of them, or an error.
using StorageReader =
    std::function<Result<std::span<const std::byte>>(std::string_view key, std::uint64_t size)>;

/// The tensors of the document's root, or of its "model_state_dict" or "state_dict" entry. `bad_file` when
/// that is no dict from distinct texts to tensors, and when the tensors together pass `byte_limit` (views may
/// share a storage).
Result<TensorMap> gather_state_dict(const pickle::Document& document, const StorageReader& storage,
                                    std::uint64_t byte_limit, std::string_view name);

}  // namespace bitr::io
