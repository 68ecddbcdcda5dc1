// SPDX-License-Identifier: BSL-1.0
#include <cles/security/checked_file.hpp>

#include "security/fleet/file_protection.hpp"
#include "security/keys/keys.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

namespace cles::security {
namespace {

constexpr int max_links = 40; // as the kernel follows

std::string absolute(const std::string& path) {
    if (path.starts_with('/')) {
        return path;
    }
    const std::unique_ptr<char, decltype(&std::free)> folder{get_current_dir_name(), std::free};
    if (!folder) {
        fail_with(errno, "cannot find the current folder");
    }
    return std::string{folder.get()} + "/" + path;
}

// With an access control list, the group's permissions are the most that any other user or group in it has.
bool has_access_list(const descriptor& file) {
    const auto path = "/proc/self/fd/" + std::to_string(file.get());
    return getxattr(path.c_str(), "system.posix_acl_access", nullptr, 0) >= 0 ||
           (errno != ENODATA && errno != EOPNOTSUPP);
}

// A group in which there is only the owner is none of other users.
bool is_changeable(const descriptor& file, const struct stat& status) {
    if ((status.st_mode & S_IWOTH) != 0) {
        return true;
    }
    return (status.st_mode & S_IWGRP) != 0 && (has_access_list(file) || !has_private_group(status));
}

/// The way from the root to a file, folder by folder, each of which is kept open: nothing on the way can be exchanged
/// after it has been checked.
class path_walk {
  public:
    explicit path_walk(const std::string& path) {
        insert_rest(absolute(path));
        descriptor root{open("/", O_PATH | O_DIRECTORY | O_CLOEXEC)};
        if (!root.is_open()) {
            fail_with(errno, "cannot open /");
        }
        const auto status = status_of(root, "/");
        top_owner_ = status.st_uid;
        enter(std::move(root), status, "");
    }

    descriptor open_file() {
        while (!rest_.empty()) {
            if (rest_.size() > 1) {
                step();
            } else if (auto file = last_step(); file.is_open()) {
                return file;
            }
        }
        throw security_error{path() + " is not a regular file"};
    }

    [[nodiscard]] std::string path() const { return way_.back().path.empty() ? "/" : way_.back().path; }
    [[nodiscard]] const std::string& flaw() const noexcept { return flaw_; }

  private:
    struct folder {
        descriptor opened;
        std::string path; // without a slash at its end
    };

    // Also "" and "." are components, which `step` skips.
    void insert_rest(std::string_view path) {
        std::vector<std::string> parts;
        for (std::size_t begin = 0; begin <= path.size();) {
            const auto end = std::min(path.find('/', begin), path.size());
            parts.emplace_back(path.substr(begin, end - begin));
            begin = end + 1;
        }
        rest_.insert(rest_.begin(), parts.begin(), parts.end());
    }
    std::string take_name() {
        auto name = std::move(rest_.front());
        rest_.pop_front();
        return name;
    }
    [[nodiscard]] std::string path_of(const std::string& name) const { return way_.back().path + "/" + name; }

    void note(const std::string& flaw) {
        if (flaw_.empty()) {
            flaw_ = flaw;
        }
    }
    // The owner of the root can replace everything. In a user namespace, that is root outside of it.
    [[nodiscard]] bool is_trusted(uid_t user) const noexcept {
        return user == 0 || user == geteuid() || user == top_owner_;
    }

    void enter(descriptor opened, const struct stat& status, const std::string& path) {
        const auto shown = path.empty() ? "/" : path;
        if (!is_trusted(status.st_uid)) {
            note(shown + " belongs to the user " + user_name(status.st_uid) +
                 ", who can replace what is in it: use another folder");
        }
        // In a folder with the sticky bit, only their owners can replace files.
        if ((status.st_mode & S_ISVTX) == 0 && is_changeable(opened, status)) {
            note(mode_flaw(status, shown));
        }
        way_.push_back({std::move(opened), path});
    }

    [[nodiscard]] descriptor open_next(const std::string& name, int flags) const {
        return descriptor{openat(way_.back().opened.get(), name.c_str(), flags | O_NOFOLLOW | O_CLOEXEC)};
    }

    // What is neither a folder nor a file has to be a link.
    void follow(const std::string& name, const std::string& path) {
        const auto link = open_next(name, O_PATH);
        if (!link.is_open()) {
            fail_with(errno, "cannot open " + path);
        }
        const auto status = status_of(link, path);
        if (!S_ISLNK(status.st_mode)) {
            fail_with(ENOTDIR, "cannot open " + path);
        }
        if (++links_ > max_links) {
            fail_with(ELOOP, "cannot open " + path);
        }
        if (!is_trusted(status.st_uid)) {
            note(path + " is a symbolic link of the user " + user_name(status.st_uid) + ": replace it");
        }
        std::array<char, 4096> target{};
        const auto size = readlinkat(link.get(), "", target.data(), target.size());
        if (size < 0 || static_cast<std::size_t>(size) == target.size()) {
            fail_with(size < 0 ? errno : ENAMETOOLONG, "cannot read the symbolic link " + path);
        }
        const std::string_view to{target.data(), static_cast<std::size_t>(size)};
        if (to.starts_with('/')) {
            way_.erase(way_.begin() + 1, way_.end());
        }
        insert_rest(to);
    }

    // Whether the name stands for no other folder than the last one or the one above.
    bool is_dots(const std::string& name) {
        if (name == ".." && way_.size() > 1) {
            way_.pop_back();
        }
        return name.empty() || name == "." || name == "..";
    }

    void step() {
        const auto name = take_name();
        if (is_dots(name)) {
            return;
        }
        const auto path = path_of(name);
        auto next = open_next(name, O_PATH | O_DIRECTORY); // which mounts it, if need be
        if (next.is_open()) {
            const auto status = status_of(next, path);
            enter(std::move(next), status, path);
        } else if (errno == ENOTDIR) {
            follow(name, path);
        } else {
            fail_with(errno, "cannot open " + path);
        }
    }

    // The file, unless it is a link.
    descriptor last_step() {
        const auto name = take_name();
        if (is_dots(name)) {
            return {};
        }
        const auto path = path_of(name);
        // A FIFO without a writer would otherwise be waited for.
        auto file = open_next(name, O_RDONLY | O_NONBLOCK);
        if (!file.is_open() && errno == ELOOP) {
            follow(name, path);
            return {};
        }
        if (!file.is_open()) {
            fail_with(errno, "cannot open " + path);
        }
        const auto status = status_of(file, path);
        if (!S_ISREG(status.st_mode)) {
            throw security_error{path + " is not a regular file"};
        }
        if (!is_trusted(status.st_uid)) {
            note(owner_flaw(status, path));
        }
        if (is_changeable(file, status)) {
            note(mode_flaw(status, path));
        }
        way_.push_back({descriptor{}, path});
        return file;
    }

    std::vector<folder> way_;
    std::deque<std::string> rest_;
    std::string flaw_;
    uid_t top_owner_ = 0;
    int links_ = 0;
};

} // namespace

checked_file::checked_file(const std::string& path) {
    path_walk way{path};
    auto file = way.open_file();
    path_ = way.path();
    flaw_ = way.flaw();
    fd_ = file.release();
}

checked_file::~checked_file() { close(fd_); }

std::string checked_file::sha256() const {
    prepare_sodium();
    crypto_hash_sha256_state state{};
    crypto_hash_sha256_init(&state);
    std::vector<std::uint8_t> part(65536);
    for (off_t at = 0;;) {
        const auto count = pread(fd_, part.data(), part.size(), at);
        if (count < 0 && errno != EINTR) {
            fail_with(errno, "cannot read " + path_);
        }
        if (count == 0) {
            break;
        }
        if (count > 0) {
            crypto_hash_sha256_update(&state, part.data(), static_cast<unsigned long long>(count));
            at += count;
        }
    }
    std::array<std::uint8_t, crypto_hash_sha256_BYTES> hash{};
    crypto_hash_sha256_final(&state, hash.data());
    std::array<char, 2 * crypto_hash_sha256_BYTES + 1> text{};
    return sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
}

} // namespace cles::security
