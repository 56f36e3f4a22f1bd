// Reads the small float64 .npy arrays among the test data (C or Fortran order), independently of the library.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>
#include <vector>

#include "support/paths.hpp"

namespace bitr::test {

inline Eigen::MatrixXd read_npy_matrix(const std::string& relative) {
  const std::filesystem::path path = data_dir() / relative;
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.good()) << path;
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::uint16_t header_size = 0;
  std::memcpy(&header_size, bytes.data() + 8, 2);
  const std::string header = bytes.substr(10, header_size);
  EXPECT_NE(header.find("<f8"), std::string::npos) << header;
  const bool fortran = header.find("'fortran_order': True") != std::string::npos;
  std::smatch shape;
  EXPECT_TRUE(std::regex_search(header, shape, std::regex(R"(\((\d+),\s*(\d*)\))"))) << header;
  const int rows = std::stoi(shape[1]), cols = shape[2].length() ? std::stoi(shape[2]) : 1;
  Eigen::MatrixXd matrix(rows, cols);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j)
      std::memcpy(&matrix(i, j),
                  bytes.data() + 10 + header_size + 8 * (fortran ? j * rows + i : i * cols + j), 8);
  return matrix;
}

}  // namespace bitr::test
