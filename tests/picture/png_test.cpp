#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>
#include <unistd.h>

#include <bitr/io.hpp>
#include <bitr/picture.hpp>

namespace bitr {
namespace {

Image decode(std::span<const std::byte> bytes) {
  png_image header = {};
  header.version = PNG_IMAGE_VERSION;
  EXPECT_TRUE(png_image_begin_read_from_memory(&header, bytes.data(), bytes.size())) << header.message;
  header.format = PNG_FORMAT_RGB;
  Image image = {
      .width = static_cast<int>(header.width), .height = static_cast<int>(header.height), .rgb = {}};
  image.rgb.resize(PNG_IMAGE_SIZE(header));
  EXPECT_TRUE(png_image_finish_read(&header, nullptr, image.rgb.data(), 0, nullptr)) << header.message;
  return image;
}

TEST(Png, DecodesToTheSamePixels) {
  Image image = {.width = 37, .height = 11, .rgb = {}};
  for (int i = 0; i < 37 * 11 * 3; ++i) image.rgb.push_back(static_cast<std::uint8_t>(i * i % 251));
  const auto bytes = encode_png(image);
  ASSERT_TRUE(bytes) << bytes.error().message;
  const Image back = decode(*bytes);
  EXPECT_EQ(back.width, 37);
  EXPECT_EQ(back.height, 11);
  EXPECT_EQ(back.rgb, image.rgb);
  EXPECT_EQ(encode_png(image).value(), *bytes);
}

TEST(Png, RefusesAnImageThatIsNotWhole) {
  for (const Image& image : {Image{}, Image{.width = 2, .height = 2, .rgb = std::vector<std::uint8_t>(11)},
                             Image{.width = -1, .height = -1, .rgb = {0, 0, 0}}}) {
    const auto bytes = encode_png(image);
    ASSERT_FALSE(bytes);
    EXPECT_EQ(bytes.error().code, ErrorCode::invalid_argument);
  }
}

TEST(Png, PictureIsWrittenWholeOrNotAtAll) {
  const PointCloud cloud = {.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .normals = {}, .colors = {}};
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("bitr_picture_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const auto written = write_picture(folder / "picture.png", cloud, cloud, {});
  ASSERT_TRUE(written) << written.error().message;
  EXPECT_EQ(decode(io::read_file(folder / "picture.png").value()).rgb,
            render_picture(cloud, cloud, {}).value().rgb);

  const auto nowhere = write_picture(folder / "none" / "picture.png", cloud, cloud, {});
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::io);
  EXPECT_THAT(nowhere.error().message, testing::HasSubstr("picture.png"));
  EXPECT_FALSE(write_picture(folder / "empty.png", {}, cloud, {}));
  EXPECT_FALSE(std::filesystem::exists(folder / "empty.png"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace bitr
