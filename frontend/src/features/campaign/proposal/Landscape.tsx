import { useState } from "react";
import { useLandscape } from "../../../api/queries";
import type { FigureCard } from "../../../api/types";
import { FigurePanel } from "../../../charts/FigurePanel";
import { More } from "./More";

const SLICE_PX = 330;
const WAITING_PX = 160;

/** Room for the slices below each other, or for the reason why there are none. */
function heightOf(card: FigureCard | undefined): number {
  if (card?.state !== "ready") return WAITING_PX;
  const axes = Object.keys((card.figure?.["layout"] ?? {}) as object).filter((name) => name.startsWith("xaxis"));
  return SLICE_PX * axes.length + 60;
}

/** The gains as a path over the model's error. It is requested, and so computed, once it is opened. */
export function Landscape({ campaignId }: { campaignId: number }) {
  const [isOpen, setOpen] = useState(false);
  const { data: card, error } = useLandscape(campaignId, isOpen);
  return (
    <More summary="Error landscape" onToggle={(event) => setOpen(event.currentTarget.open)}>
      {isOpen && (
        <FigurePanel
          title="Error landscape predicted by the model"
          card={card}
          error={error}
          height={heightOf(card)}
          build="contours"
          tallest="400vw"
        />
      )}
    </More>
  );
}
