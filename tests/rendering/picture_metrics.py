"""Comparison of images, exact for one rasteriser and structural between two."""

import numpy as np

SAME_DIFFERENCE = 2  # maximum difference in any channel, of 255
SAME_SHARE = 0.0005  # fraction of pixels that may differ more
OTHER_SSIM_ERROR = 0.02  # 1 - mean structural similarity of the luma
OTHER_SILHOUETTE = 0.005  # fraction of pixels covered in only one of two images

_WINDOW = 8  # side of the windows of SSIM in pixels


def differing_share(first, second) -> float:
    """Return the fraction of pixels in which a channel differs by more than SAME_DIFFERENCE."""
    difference = np.abs(first.astype(np.int16) - second.astype(np.int16)).max(axis=-1)
    return float((difference > SAME_DIFFERENCE).mean())


def ssim_error(first, second) -> float:
    """Return 1 - SSIM, the mean over 8 x 8 windows and R, G, B over grey (Wang et al. 2004)."""
    errors = []
    for channel in range(3):
        a, b = _on_grey(first)[..., channel], _on_grey(second)[..., channel]
        mean_a, mean_b = _window_means(a), _window_means(b)
        var_a = np.maximum(_window_means(a * a) - mean_a**2, 0.0)
        var_b = np.maximum(_window_means(b * b) - mean_b**2, 0.0)
        covariance = _window_means(a * b) - mean_a * mean_b
        c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
        similarity = ((2 * mean_a * mean_b + c1) * (2 * covariance + c2)) / (
            (mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)
        )
        errors.append(1.0 - similarity.mean())
    return float(np.mean(errors))


def silhouette_share(first, second) -> float:
    """Return the fraction of pixels that only one image covers, with an alpha of at least half."""
    return float(((first[..., 3] >= 128) != (second[..., 3] >= 128)).mean())


def complaints(
    found, wanted, same_rasteriser: bool, ssim_limit: float = OTHER_SSIM_ERROR
) -> list[str]:
    """Return the differences of an image from the expected one; empty if it is accepted."""
    if found.shape != wanted.shape:
        return [f"size {found.shape} instead of {wanted.shape}"]
    if same_rasteriser:
        share = differing_share(found, wanted)
        if share <= SAME_SHARE:
            return []
        return [f"{share:.3%} of the pixels differ by more than {SAME_DIFFERENCE}/255"]
    problems = []
    if (error := ssim_error(found, wanted)) > ssim_limit:
        problems.append(f"SSIM error {error:.4f}, at most {ssim_limit} is allowed")
    if (share := silhouette_share(found, wanted)) > OTHER_SILHOUETTE:
        problems.append(f"{share:.3%} of the silhouette differ, at most {OTHER_SILHOUETTE:.1%}")
    return problems


def _on_grey(pixels):
    """Return the colours over mid-grey, which gives transparent pixels a colour."""
    alpha = pixels[..., 3:].astype(np.float64) / 255.0
    return pixels[..., :3] * alpha + 128.0 * (1.0 - alpha)


def _window_means(values):
    sums = np.zeros((values.shape[0] + 1, values.shape[1] + 1))
    sums[1:, 1:] = values.cumsum(axis=0).cumsum(axis=1)
    w = _WINDOW
    return (sums[w:, w:] - sums[:-w, w:] - sums[w:, :-w] + sums[:-w, :-w]) / w**2
