// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/plugin_abi.h>

// With the standard library's file system no further library of Boost is linked.
#ifndef BOOST_DLL_USE_STD_FS
#define BOOST_DLL_USE_STD_FS
#endif
#include <boost/dll/shared_library.hpp>

#include <filesystem>
#include <string>

namespace cles::runtime {

/// Loads a plugin's library, which runs its initialization. \param path as written in the configuration
/// \throws plugin_error
boost::dll::shared_library open_library(const std::string& path, const std::filesystem::path& file);

/// Calls a plugin's entry point and checks the description that it returns. \throws plugin_error
const cles_plugin& describe_plugin(const std::string& path, const boost::dll::shared_library& library);

} // namespace cles::runtime
