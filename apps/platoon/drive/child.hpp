// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

#include <sys/types.h>

namespace platoon {

/// A child process that runs this program, with its output in unnamed files. It ends when its parent ends.
class child {
  public:
    /// \param network the descriptor of the network namespace in which it runs; -1: in this one
    /// \param inherited descriptors that it gets, with the same numbers
    /// \throws std::system_error if it cannot be started
    explicit child(const std::vector<std::string>& arguments, int network = -1, const std::vector<int>& inherited = {});
    child(child&& other) noexcept;
    child& operator=(child&&) = delete;
    child(const child&) = delete;
    child& operator=(const child&) = delete;
    /// Kills it if it still runs.
    ~child();

    [[nodiscard]] pid_t pid() const noexcept { return pid_; }
    /// Whether it still runs; if not, `status` is valid.
    bool running();
    [[nodiscard]] int status() const noexcept { return status_; }
    void signal(int number) const;
    [[nodiscard]] std::string output() const { return read(out_); }
    [[nodiscard]] std::string errors() const { return read(err_); }

  private:
    static std::string read(int file);

    pid_t pid_ = -1;
    bool ended_ = false;
    int status_ = 0;
    int out_ = -1, err_ = -1;
};

} // namespace platoon
