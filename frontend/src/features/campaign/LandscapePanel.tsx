import { useComputedColorScheme } from "@mantine/core";
import { useIdle, useMediaQuery } from "@mantine/hooks";
import { useEffect, useRef, useState } from "react";
import { useLandscape } from "../../api/landscape";
import type { FigureCard } from "../../api/types";
import { FigurePanel } from "../../charts/FigurePanel";
import classes from "./LandscapePanel.module.css";

const BESIDE_PX = 420;
const STACKED_PX = 330;
const WAITING_PX = 160;
const IDLE_MS = 1500;

function heightOf(card: FigureCard | undefined, stacked: boolean): number {
  if (card?.state !== "ready") return WAITING_PX;
  const axes = Object.keys((card.figure?.["layout"] ?? {}) as object).filter((name) => name.startsWith("xaxis"));
  return stacked ? STACKED_PX * axes.length + 60 : BESIDE_PX;
}

/**
 * The gains as a path over the model's error. Drawing it is slow, so it is drawn when it is in view or the user is idle.
 */
export function LandscapePanel({ campaignId }: { campaignId: number }) {
  const place = useRef<HTMLDivElement>(null);
  const [inView, setInView] = useState(false);
  const [seen, setSeen] = useState(false);
  const [shown, setShown] = useState<FigureCard | undefined>(undefined);
  const idle = useIdle(IDLE_MS);
  const theme = useComputedColorScheme("light");
  const stacked = useMediaQuery("(max-width: 820px)", false, { getInitialValueInEffect: false });
  const landscape = useLandscape(campaignId, theme, stacked, seen);
  useEffect(() => {
    const target = place.current;
    if (target === null) return;
    const observer = new IntersectionObserver((entries) => setInView(entries.at(-1)?.isIntersecting ?? false));
    observer.observe(target);
    return () => observer.disconnect();
  }, []);
  if (inView && !seen) setSeen(true);
  if ((inView || (seen && idle)) && shown !== landscape.data) setShown(landscape.data);
  return (
    <div ref={place} className={classes["place"]}>
      <FigurePanel
        title="Error landscape of the model"
        card={shown}
        error={landscape.error}
        wanted={seen}
        height={heightOf(shown, stacked)}
        build="contours"
      />
    </div>
  );
}
