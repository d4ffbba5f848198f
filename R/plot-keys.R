# Text and keys above and in plots, beside legend_above(): titles that fit, bars of colours,
# remarks.

# Draws a title above the line of the legend, smaller where the plot is narrow.
title_above <- function(main) {
  if (!length(main) || !nzchar(main[[1L]])) {
    return(invisible())
  }
  cex <- graphics::par("cex.main")
  wide <- max(graphics::strwidth(main, "inches", cex = cex, font = 2L))
  # The title is centred over the plot, whose middle is not that of the figure.
  middle <- mean(graphics::grconvertX(0:1, "npc", "inches"))
  room <- 2 * min(abs(graphics::grconvertX(0:1, "nfc", "inches") - middle))
  graphics::title(main = main, line = 2.5, cex.main = cex * min(1, 0.98 * room / wide))
}

#' Draw a bar of colours with its ends' values in one line above the plot
#' @param key A list: `palette`, `ends` (two strings), `label`; `NULL` for none.
#' @noRd
colour_key_above <- function(key, cex = 0.9) {
  if (is.null(key)) {
    return(invisible())
  }
  width <- function(text) graphics::strwidth(text, "inches", cex = cex)
  em <- graphics::strwidth("M", "inches", cex = cex)
  texts <- width(key$label) + width(key$ends[[1L]]) + width(key$ends[[2L]]) + 3 * em
  sides <- graphics::grconvertX(0:1, "npc", "inches")
  long <- max(min(diff(sides) - texts, 12 * em), 3 * em)
  left <- mean(sides) - (long + texts) / 2
  label <- left + width(key$label) + em
  bar <- label + width(key$ends[[1L]]) + 0.6 * em
  height <- graphics::grconvertY(1, "npc", "inches") + 0.9 * graphics::par("csi")
  x <- function(inches) graphics::grconvertX(inches, "inches", "user")
  y <- function(inches) graphics::grconvertY(inches, "inches", "user")
  write <- function(inches, text) {
    graphics::text(x(inches), y(height), text, adj = c(0, 0.4), cex = cex, xpd = NA)
  }
  write(left, key$label)
  write(label, key$ends[[1L]])
  half <- 0.3 * graphics::par("csi")
  graphics::rasterImage(t(key$palette), x(bar), y(height - half), x(bar + long), y(height + half),
                        xpd = NA, interpolate = FALSE)
  graphics::rect(x(bar), y(height - half), x(bar + long), y(height + half), xpd = NA, lwd = 0.5)
  write(bar + long + 0.6 * em, key$ends[[2L]])
  invisible(list(left = left, right = left + long + texts))
}

#' Write a remark into the upper right corner of a plot, smaller where that is narrow
#' @param lines Lines of text; none draw nothing.
#' @param right Where they end, in the plot's own units.
#' @noRd
corner_text <- function(lines, right = graphics::grconvertX(0.98, "npc", "user"), cex = 0.9) {
  if (!length(lines)) {
    return(invisible())
  }
  wide <- max(graphics::strwidth(lines, "inches", cex = cex))
  cex <- cex * min(1, 0.5 * graphics::par("pin")[[1L]] / wide)
  top <- graphics::grconvertY(0.98, "npc", "inches")
  heights <- top - 1.3 * cex * graphics::par("csi") * seq_along(lines)
  graphics::text(right, graphics::grconvertY(heights, "inches", "user"), lines,
                 adj = c(1, 0), cex = cex, col = okabe_ito$vermillion)
}
