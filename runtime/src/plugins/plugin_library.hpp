// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/plugin_abi.h>

#include <boost/dll/shared_library.hpp>

#include <filesystem>
#include <string>

// The standard library's file system, so that no further library of Boost is linked.
#ifndef BOOST_DLL_USE_STD_FS
#define BOOST_DLL_USE_STD_FS
#endif

namespace cles::runtime {

/// Loads a plugin's library, which runs code of it. \param path as the configuration names it \throws plugin_error
boost::dll::shared_library open_library(const std::string& path, const std::filesystem::path& file);

/// Calls a plugin's entry point: what it says of itself, which this host can do with. \throws plugin_error
const cles_plugin& describe_plugin(const std::string& path, const boost::dll::shared_library& library);

} // namespace cles::runtime
