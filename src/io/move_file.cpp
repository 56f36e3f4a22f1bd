// A cloud's file again, with the cloud somewhere else.
#include <new>
#include <string>

#include "io/complaint.hpp"
#include "io/formats.hpp"
#include "io/mover.hpp"

namespace bitr::io {

Result<std::vector<std::byte>> moved_file(const std::filesystem::path& in, const std::filesystem::path& out,
                                          const Pose& T) {
  const auto format = cloud_format(in);
  if (!format) return tl::unexpected(format.error());
  if (extension_of(in) != extension_of(out)) {
    return fail(ErrorCode::invalid_argument,
                text(label(out.native()), ": extension ", in_quotes(extension_of(out)), " is not that of ",
                     label(in.native()), ", whose format a moved copy has"));
  }
  const auto bytes = read_file(in);
  if (!bytes) return tl::unexpected(bytes.error());
  return moved_geometry(*bytes, *format, in.native(), T);
}

Result<std::vector<std::byte>> moved_geometry(std::span<const std::byte> bytes, CloudFormat format,
                                              std::string_view name, const Pose& T) try {
  Mover mover(bytes, T);
  const auto read = parse_file({.bytes = bytes, .name = name, .mover = &mover, .bare_points = true}, format);
  if (!read) return tl::unexpected(read.error());
  return mover.finish();
} catch (const std::bad_alloc&) {
  return fail(ErrorCode::io, text(label(name), ": too large for this machine's memory"));
}

Result<void> check_move(const std::filesystem::path& in, const std::filesystem::path& out) {
  const auto moved = moved_file(in, out, {});
  return moved ? Result<void>() : tl::unexpected(moved.error());
}

Result<void> move_cloud_file(const std::filesystem::path& in, const std::filesystem::path& out,
                             const Pose& T) {
  const auto moved = moved_file(in, out, T);
  return moved ? write_file(out, *moved) : tl::unexpected(moved.error());
}

}  // namespace bitr::io
