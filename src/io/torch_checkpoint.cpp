#include "io/torch_checkpoint.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <unordered_map>

#include "io/pickle.hpp"
#include "io/quote.hpp"
#include "io/state_dict.hpp"
#include "io/zip_archive.hpp"

namespace bitr::io {
namespace {

constexpr std::size_t key_limit = 255;

/// torch.save before 1.6 wrote no archive: a pickled magic number, then one pickle after another.
bool is_legacy(std::span<const std::byte> bytes) {
  constexpr std::array<unsigned char, 14> magic = {0x80, 0x02, 0x8a, 0x0a, 0x6c, 0xfc, 0x9c,
                                                   0x46, 0xf9, 0x20, 0x6a, 0xa8, 0x50, 0x19};
  return bytes.size() >= magic.size() &&
         std::equal(magic.begin(), magic.end(), bytes.begin(),
                    [](unsigned char a, std::byte b) { return std::byte{a} == b; });
}

/// The archive's one top-level folder that holds a data.pkl.
Result<std::string> root_folder(const ZipArchive& archive, const std::string& name) {
  constexpr std::string_view file = "/data.pkl";
  std::optional<std::string> root;
  for (const std::string& path : archive.paths()) {
    const std::size_t slash = path.find('/');
    if (slash == std::string::npos || path.substr(slash) != file) continue;
    if (root) return fail(ErrorCode::bad_file, name + ": more than one data.pkl");
    root = path.substr(0, slash);
  }
  if (!root) return fail(ErrorCode::bad_file, name + ": no data.pkl: not an archive of torch.save");
  if (archive.contains(*root + "/constants.pkl")) {
    return fail(ErrorCode::unsupported, name + ": a TorchScript archive, not a state dict of torch.save");
  }
  return *root;
}

}  // namespace

Result<TensorMap> parse_torch_checkpoint(std::span<const std::byte> bytes, std::string_view name) {
  const std::string file(name);
  if (is_legacy(bytes)) {
    return fail(ErrorCode::unsupported,
                file + ": torch.save's format before PyTorch 1.6; load and save it once with a later one");
  }
  const auto prefixed = [&](const Error& error) { return fail(error.code, file + ": " + error.message); };
  auto archive = ZipArchive::open(bytes);
  if (!archive) return prefixed(archive.error());
  const auto root = root_folder(*archive, file);
  if (!root) return tl::unexpected(root.error());

  if (const std::string path = *root + "/byteorder"; archive->contains(path)) {
    const auto order = archive->read(path);
    if (!order) return prefixed(order.error());
    const std::string text(reinterpret_cast<const char*>(order->data()), order->size());
    if (text != "little")
      return fail(ErrorCode::unsupported, file + ": byte order " + in_quotes(text) + ", not \"little\"");
  }

  const auto data = archive->read(*root + "/data.pkl");
  if (!data) return prefixed(data.error());
  const auto document = pickle::parse(*data, file + ": data.pkl");
  if (!document) return tl::unexpected(document.error());

  std::unordered_map<std::string, std::vector<std::byte>> storages;
  const StorageReader storage = [&](std::string_view key,
                                    std::uint64_t size) -> Result<std::span<const std::byte>> {
    if (key.size() > key_limit) {
      return fail(ErrorCode::bad_file, "a storage's key has " + std::to_string(key.size()) +
                                           " bytes, limit " + std::to_string(key_limit));
    }
    auto found = storages.find(std::string(key));
    if (found == storages.end()) {
      auto content = archive->read(*root + "/data/" + std::string(key));
      if (!content) return tl::unexpected(content.error());
      found = storages.emplace(key, std::move(*content)).first;
    }
    if (found->second.size() != size) {
      return fail(ErrorCode::bad_file, "storage " + in_quotes(key) + " has " +
                                           std::to_string(found->second.size()) +
                                           " bytes, its class and length need " + std::to_string(size));
    }
    return found->second;
  };
  return gather_state_dict(*document, storage, 64 * std::uint64_t{bytes.size()}, name);
}

}  // namespace bitr::io
