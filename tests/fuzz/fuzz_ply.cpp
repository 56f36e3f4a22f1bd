// Beyond reading: what was read is written, and reads back the same.
#include "fuzz_geometry.hpp"
#include "io/formats.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bitr::io;
  const auto geometry = fuzz_geometry(data, size, CloudFormat::ply);
  if (!geometry) return 0;
  for (const auto encoding : {PlyEncoding::ascii, PlyEncoding::binary_little_endian}) {
    const auto bytes = serialize_ply(geometry->cloud, encoding);
    require(bytes.has_value());
    const auto again = parse_geometry(*bytes, CloudFormat::ply, "again.ply");
    require(again.has_value());
    require(again->cloud.positions == geometry->cloud.positions);
    require(again->cloud.normals == geometry->cloud.normals);
    require(again->cloud.colors.size() == geometry->cloud.colors.size());
  }
  return 0;
}
