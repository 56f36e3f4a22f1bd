// Everything: read clouds, solve, or load a model, make a plan, assemble.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/confidence.hpp>
#include <bitr/device.hpp>
#include <bitr/doctor.hpp>
#include <bitr/io.hpp>
#include <bitr/model.hpp>
#include <bitr/pose.hpp>
#include <bitr/refine.hpp>
#include <bitr/result.hpp>
#include <bitr/solve.hpp>
