// Points that look for their nearest in other clouds, for many clouds in one submission.
#pragma once

#include <array>
#include <bitr/cloud.hpp>
#include <span>
#include <vector>

#include "vk/parameters.hpp"
#include "vk/submitter.hpp"

namespace bitr::vk {

class Nearest {
 public:
  static constexpr std::uint32_t most_wanted = 16;

  /// A cloud in the order of its tree (shaders/common/knn_tree.glsl), in a frame and a scale of its own.
  struct Cloud {
    Vec3d centre{};
    double scale = 1;  ///< coordinates on the device are in −1 … 1
    std::vector<std::array<std::uint32_t, 4>> sorted;
    std::vector<std::array<float, 8>> boxes;
    explicit Cloud(const std::vector<Vec3d>& points);

    /// Whether single precision tells the cloud's points apart from there.
    bool sees(const Vec3d& point) const;
    void write(const Vec3d& point, float* query) const;
  };

  /// Indices of points in the order in which they had best look: neighbours one after the other.
  static std::vector<std::uint32_t> order_of(const std::vector<Vec3d>& points);

  struct Request {
    std::uint32_t cloud = 0;
    std::uint32_t wanted = 1;  ///< how many nearest each wants, 1 or most_wanted
    std::size_t count = 0;     ///< how many points look
  };

  explicit Nearest(const Context& context);

  /// Keeps it; returns its number.
  std::uint32_t add(Cloud cloud);
  const Cloud& cloud(std::uint32_t number) const { return clouds_[number]; }

  void lay_out(std::span<const Request> requests);
  /// After lay_out(), before run(): where Cloud::write() is to put points, four numbers each.
  float* queries(std::size_t request) const;
  void run();
  /// After run(): rows of the `wanted` nearest of each point, nearest first; `none` where there are fewer or
  /// the search gave up, which takes tens of thousands of points in reach.
  const std::uint32_t* found(std::size_t request) const;
  static constexpr std::uint32_t none = 0xffffffff;

 private:
  struct Group {
    std::uint32_t wanted;
    PipelineOf<TileParameters> pipeline;
    std::size_t rows = 0, first_row = 0, first_tile = 0;  // among all groups' queries and tiles
    std::vector<std::array<std::uint32_t, 4>> tiles = {};
    std::size_t index_begin = 0;  // bytes
  };
  struct Place {
    std::size_t group, row;  // in the group
  };
  void upload_clouds();

  const Context& context_;
  std::vector<Cloud> clouds_;
  std::size_t uploaded_ = 0;  // so many of them are on the device
  std::vector<Group> groups_;
  std::vector<Place> places_;
  Buffer cloud_buffer_, staging_, input_, index_, readback_;
  Range table_, sorted_, boxes_;
  std::size_t tile_bytes_ = 0, query_bytes_ = 0, index_bytes_ = 0;
  Submitter submitter_;
};

}  // namespace bitr::vk
