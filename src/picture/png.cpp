// Images as PNG files.
#include <png.h>

#include <bitr/picture.hpp>
#include <string>

#include "core/guarded.hpp"

namespace bitr {

Result<std::vector<std::byte>> encode_png(const Image& image) {
  return guarded([&]() -> Result<std::vector<std::byte>> {
    if (image.width < 1 || image.height < 1 ||
        image.rgb.size() != std::size_t{3} * static_cast<std::size_t>(image.width) * image.height)
      return fail(ErrorCode::invalid_argument, "an image of " + std::to_string(image.width) + " x " +
                                                   std::to_string(image.height) + " pixels cannot have " +
                                                   std::to_string(image.rgb.size()) + " bytes");
    png_image header = {};
    header.version = PNG_IMAGE_VERSION;
    header.width = static_cast<png_uint_32>(image.width);
    header.height = static_cast<png_uint_32>(image.height);
    header.format = PNG_FORMAT_RGB;
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(header);
    std::vector<std::byte> bytes(size);
    const int written =
        png_image_write_to_memory(&header, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr);
    if (!written) return fail(ErrorCode::internal, std::string("libpng: ") + header.message);
    bytes.resize(size);
    return bytes;
  });
}

}  // namespace bitr
