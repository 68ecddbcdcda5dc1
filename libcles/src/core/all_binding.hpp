// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/call.hpp"
#include "core/deadlines.hpp"
#include "core/relayed_bindings.hpp"
#include "core/routing.hpp"
#include "core/topic.hpp"

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// A noun bound on all who publish it, for one link: on those that are known, and on each that appears later. Its
/// answer says what each had published last.
class all_binding final : public routing::errand, private deadline, public std::enable_shared_from_this<all_binding> {
  public:
    all_binding(std::shared_ptr<routing> by, const protocol::request_line& r, std::string path, relayed_bindings& place,
                binding::terms wanted, std::shared_ptr<call> answers, time_point due);

    /// False where it has to wait for others to be heard of.
    bool begin(time_point now) override;
    [[nodiscard]] bool over() const override { return closed_; }
    /// Others may publish it now, or no more.
    void follow();
    /// Unbinds all, but for what its heir has. Nothing of `place` is used any more.
    void close(const all_binding* heir = nullptr);

  private:
    struct part {
        std::optional<std::string> last{};
        std::optional<update_mark> mark{};
        std::optional<protocol::failure> failure{};
        bool asked = true;  // until it has answered
        bool bound = false; // with a failure too, where there was no memory for its last value
    };

    void bind_whom_is_known(time_point now);
    void join(const std::string& node);
    void on_told(const std::string& node, topic* t, std::string_view last, const protocol::failure& why);
    void on_deadline(time_point now) override;
    void answer_when_whole();
    void answer();
    [[nodiscard]] bool passed(std::string_view node) const;

    std::shared_ptr<routing> routing_;
    std::string task_;
    std::string path_;
    std::string via_;
    std::string adverbs_;
    bool may_pass_on_;
    bool wants_mark_;
    relayed_bindings& place_;
    binding::terms wanted_;
    std::shared_ptr<call> call_;
    time_point due_;
    std::map<std::string, part, std::less<>> parts_; // by node
    bool begun_ = false;
    bool joining_ = false;
    bool closed_ = false;
};

} // namespace cles::core
