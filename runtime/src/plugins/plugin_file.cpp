// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_file.hpp"

#include "plugins/plugin_library.hpp"

#include <utility>

#ifdef CLES_WITH_SECURITY
#include <cles/security/checked_file.hpp>

#include <algorithm>
#include <exception>
#include <mutex>
#include <system_error>

#include <sys/stat.h>
#endif

namespace cles::runtime {

plugin_rules plugin_rules_of(const config& setup) {
    return {.secured = setup.security.is_on(), .folders = plugin_search_path(setup)};
}

#ifdef CLES_WITH_SECURITY

namespace fs = std::filesystem;

namespace {

std::shared_ptr<const security::checked_file> open_checked(const std::string& path, const fs::path& file) {
    try {
        auto opened = std::make_shared<const security::checked_file>(file.string());
        if (!opened->flaw().empty()) {
            throw plugin_error(path, opened->flaw());
        }
        return opened;
    } catch (const plugin_error&) {
        throw;
    } catch (const std::exception& e) {
        throw plugin_error(path, e.what());
    }
}

bool is_inside(const fs::path& file, const fs::path& folder) {
    std::error_code missing;
    const auto real = fs::canonical(folder, missing);
    return !missing && std::mismatch(real.begin(), real.end(), file.begin(), file.end()).first == real.end();
}

void require_allowed_folder(const std::string& path, const fs::path& file, const plugin_rules& rules) {
    const auto& all = rules.folders;
    if (std::none_of(all.begin(), all.end(), [&](const fs::path& folder) { return is_inside(file, folder); })) {
        throw plugin_error(path, "with 'security', plugins are loaded only from the folders in 'plugin_path' and those "
                                 "that are part of CLES: add " +
                                     file.parent_path().string() + " to 'plugin_path', or move it");
    }
}

void require_pin(const std::string& path, const security::checked_file& file, const std::string& sha256) {
    std::string found;
    try {
        found = file.sha256();
    } catch (const std::exception& e) {
        throw plugin_error(path, e.what());
    }
    if (found != sha256) {
        throw plugin_error(path,
                           "the SHA-256 of " + file.path() + " is " + found +
                               ", not the configured one: if you know why the file has changed, set sha256 to this",
                           "sha256");
    }
}

} // namespace

plugin_file::plugin_file(const std::string& path, fs::path file, const plugin_rules& rules, const std::string& sha256)
    : path_(std::move(file)) {
    if (!rules.secured && sha256.empty()) {
        return;
    }
    checked_ = open_checked(path, path_);
    path_ = checked_->path();
    if (rules.secured) {
        require_allowed_folder(path, path_, rules);
    }
    if (!sha256.empty()) {
        require_pin(path, *checked_, sha256);
    }
}

fs::path plugin_file::loader_path(const std::string& path) const {
    if (!checked_) {
        return path_;
    }
    // Not through "self", so that a debugger finds the file, too.
    std::error_code missing;
    const auto own = fs::read_symlink("/proc/self", missing);
    auto opened = "/proc" / own / "fd" / std::to_string(checked_->descriptor());
    struct stat wanted {};
    struct stat found {};
    if (missing || ::fstat(checked_->descriptor(), &wanted) != 0 || ::stat(opened.c_str(), &found) != 0 ||
        wanted.st_dev != found.st_dev || wanted.st_ino != found.st_ino) {
        throw plugin_error(path, "the file that was checked cannot be loaded, because /proc is not mounted: mount it "
                                 "(mount -t proc proc /proc)");
    }
    return opened;
}

void plugin_file::keep_open() const {
    static std::mutex mutex;
    static auto* const all = new std::vector<std::shared_ptr<const security::checked_file>>;
    const std::scoped_lock lock{mutex};
    all->push_back(checked_);
}

#else

plugin_file::plugin_file(const std::string& path, std::filesystem::path file, const plugin_rules& /*rules*/,
                         const std::string& sha256)
    : path_(std::move(file)) {
    if (!sha256.empty()) {
        throw plugin_error(path, "this clesd was built without security, so it cannot check a SHA-256", "sha256");
    }
}

std::filesystem::path plugin_file::loader_path(const std::string& /*path*/) const { return path_; }

void plugin_file::keep_open() const {}

#endif

} // namespace cles::runtime
