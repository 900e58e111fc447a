import { createTheme, type MantineColorsTuple } from "@mantine/core";

/** The accent: primary actions and the best flight. Shade 7 carries white text at 5:1. */
const petrol: MantineColorsTuple = [
  "#e6f7f4",
  "#cdeee8",
  "#9bdcd1",
  "#65c9b8",
  "#3fd0bb",
  "#1c9f8e",
  "#0d8b7c",
  "#0a7a6c",
  "#06655a",
  "#034f46",
];

/** Destructive actions. Shade 7 carries white text at 6:1. */
const red: MantineColorsTuple = [
  "#fcebea",
  "#f8d3d0",
  "#f0aaa5",
  "#ea837c",
  "#e2604f",
  "#d6352c",
  "#cc2a21",
  "#c21f17",
  "#a01811",
  "#7d110c",
];

/** Mantine's greys for the dark theme, with a blue tint like the page background. */
const dark: MantineColorsTuple = [
  "#eef2f6",
  "#c9d1da",
  "#a9b4c1",
  "#75818f",
  "#3b444f",
  "#2d343e",
  "#1f252e",
  "#181d24",
  "#10141a",
  "#0b0e12",
];

const TOUCH_TARGET_PX = 48;

const tall = { styles: { input: { minHeight: TOUCH_TARGET_PX } }, defaultProps: { size: "md" } } as const;

export const theme = createTheme({
  colors: { petrol, red, dark },
  primaryColor: "petrol",
  primaryShade: 7,
  defaultRadius: "md",
  radius: { md: "10px" },
  fontFamily: "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'DejaVu Sans', sans-serif",
  fontSizes: {
    fine: "var(--text-fine)",
    small: "var(--text-small)",
    body: "var(--text-body)",
    strong: "var(--text-strong)",
    title: "var(--text-title)",
  },
  headings: { fontWeight: "650", sizes: { h1: { fontSize: "var(--text-page)", lineHeight: "1.55" } } },
  /** Phones end below xs; the bar is cramped below md, and in flight below lg. */
  breakpoints: { xs: "621px", sm: "51.3125em", md: "1181px", lg: "1321px" },
  cursorType: "pointer",
  respectReducedMotion: true,
  components: {
    Button: { defaultProps: { size: "md" }, styles: { root: { minHeight: TOUCH_TARGET_PX } } },
    ActionIcon: { defaultProps: { size: TOUCH_TARGET_PX, variant: "subtle" } },
    TextInput: tall,
    InputBase: tall,
    NativeSelect: tall,
    Title: { styles: { root: { letterSpacing: "-0.015em" } } },
  },
});
