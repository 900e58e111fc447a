import { useComputedColorScheme } from "@mantine/core";
import { useMediaQuery } from "@mantine/hooks";
import { useEffect, useRef, useState } from "react";
import { useLandscape } from "../api/landscape";
import type { FigureCard } from "../api/types";
import { FigurePanel } from "./FigurePanel";
import classes from "./LandscapePanel.module.css";

const BESIDE_PX = 420;
const STACKED_PX = 330;
const WAITING_PX = 160;

function heightOf(card: FigureCard | undefined, stacked: boolean): number {
  if (card?.state !== "ready") return WAITING_PX;
  const axes = Object.keys((card.figure?.["layout"] ?? {}) as object).filter((name) => name.startsWith("xaxis"));
  return stacked ? STACKED_PX * axes.length + 60 : BESIDE_PX;
}

/** The gains as a path over the model's error. */
export function LandscapePanel({ campaignId }: { campaignId: number }) {
  const place = useRef<HTMLDivElement>(null);
  const [seen, setSeen] = useState(false);
  const theme = useComputedColorScheme("light");
  const stacked = useMediaQuery("(max-width: 820px)", false, { getInitialValueInEffect: false });
  const landscape = useLandscape(campaignId, theme, stacked, seen);
  useEffect(() => {
    const target = place.current;
    if (target === null || seen) return;
    const observer = new IntersectionObserver((entries) => entries.some((one) => one.isIntersecting) && setSeen(true));
    observer.observe(target);
    return () => observer.disconnect();
  }, [seen]);
  return (
    <div ref={place} className={classes["place"]}>
      <FigurePanel
        title="Error landscape of the model"
        card={landscape.data}
        error={landscape.error}
        wanted={seen}
        height={heightOf(landscape.data, stacked)}
      />
    </div>
  );
}
